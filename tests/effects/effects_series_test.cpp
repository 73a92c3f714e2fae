/// Effects over a stretch of a recording, each against a computation of its own: closed forms,
/// finely stepped equations, MuJoCo's Jacobian, rotated robots.

#include <cmath>
#include <functional>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/effects/series.hpp>

#include "support/joint_waves.hpp"
#include "support/matrix_near.hpp"
#include "support/mujoco_tree.hpp"
#include "support/random_arm.hpp"

namespace effects_series_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// z(t) of ż = f(t, z), z(0) = z0, sampled: Runge–Kutta of order 4 with steps of dt/`fine`.
VecX<double> integrated(const std::function<double(double, double)>& f, double z0, int fine) {
  VecX<double> out(kRows);
  double z = z0;
  const double h = kDt / fine;
  for (long k = 0; k < kRows; ++k) {
    out[k] = z;
    for (int i = 0; i < fine; ++i) {
      const double t = static_cast<double>(k) * kDt + i * h;
      const double a = f(t, z), b = f(t + h / 2, z + h / 2 * a), c = f(t + h / 2, z + h / 2 * b),
                   d = f(t + h, z + h * c);
      z += h / 6 * (a + 2 * b + 2 * c + d);
    }
  }
  return out;
}

}  // namespace

TEST_CASE("series: numerics on the grid are of order four, lag exact on straight lines",
          "[effects]") {
  const Function wave = [](double t) { return std::sin(20.0 * t); };
  const auto off = [&](double dt) {
    const VecX<double> f = sampled(wave, dt, 400);
    const VecX<double> slope = sampled([](double t) { return 20.0 * std::cos(20.0 * t); }, dt, 400);
    return (derivative(f, dt) - slope).cwiseAbs().maxCoeff();
  };
  CHECK(off(2e-3) < 2e-4);
  CHECK(off(1e-3) < off(2e-3) / 12.0);  // 16 in the limit
  const double d = 2.345e-3;
  const VecX<double> moved = shifted(sampled(wave), kDt, d);
  const VecX<double> expected = sampled([&](double t) { return wave(t + d); });
  CHECK((moved - expected).head(kRows - 3).cwiseAbs().maxCoeff() < 1e-8);  // (20·1e-3)⁴/384 · …
  CHECK_THAT(shifted(sampled(wave), kDt, 0.0), MatrixNear(sampled(wave), 0.0));
  const VecX<double> ramp = sampled([](double t) { return 3.0 * t - 1.0; });
  CHECK_THAT(low_passed(ramp, kDt, 0.02),
             MatrixNear(sampled([](double t) { return 3.0 * (t - 0.02) - 1.0; }), 1e-12));
  for (const long rows : {0L, 1L, 2L, 4L}) {
    CHECK(derivative(VecX<double>::LinSpaced(rows, 0.0, 1.0), 1.0).size() == rows);
    CHECK(shifted(VecX<double>::Ones(rows), 1.0, 0.5) == VecX<double>::Ones(rows));
    CHECK(low_passed(VecX<double>::Ones(rows), 1.0, 0.5) == VecX<double>::Ones(rows));
  }
}

TEST_CASE("actuator_lag: the log is the command whose lag is the torque", "[effects]") {
  const double T = 0.02;
  const Function command = [](double t) { return 4.0 * std::sin(12.0 * t) + std::cos(31.0 * t); };
  JointSeries x = rail_at_rest();
  x.total = integrated([&](double t, double u) { return (command(t) - u) / T; }, 1.0, 10);
  const RowMatX<double> added =
      torque_on_rail({"actuator_lag", "slide", {{"time_constant", T, "s"}}}, x);
  CHECK_THAT((x.total + added).eval(), MatrixNear(RowMatX<double>(sampled(command)), 1e-5));
}

TEST_CASE("actuator_delay: the log is the torque of a later moment", "[effects]") {
  const double d = 7.3e-3;
  const Function command = [](double t) { return 4.0 * std::sin(12.0 * t) + std::cos(31.0 * t); };
  JointSeries x = rail_at_rest();
  x.total = sampled([&](double t) { return command(t - d); });
  const RowMatX<double> added = torque_on_rail({"actuator_delay", "slide", {{"delay", d, "s"}}}, x);
  const long rows = kRows - 10;  // beyond the end nothing is known
  CHECK_THAT((x.total + added).topRows(rows).eval(),
             MatrixNear(RowMatX<double>(sampled(command)).topRows(rows), 1e-6));
}

TEST_CASE("saturation: the log exceeds the torque by what the limit cuts", "[effects]") {
  JointSeries x = rail_at_rest();
  x.logged = sampled([](double t) { return 10.0 * std::sin(12.0 * t); });
  const EffectSpec spec{"saturation", "slide", {{"limit", 6.0, "N"}}};
  const RowMatX<double> expected = sampled([](double t) {
    const double u = 10.0 * std::sin(12.0 * t);
    return u > 6.0 ? u - 6.0 : u < -6.0 ? u + 6.0 : 0.0;
  });
  CHECK_THAT(torque_on_rail(spec, x), MatrixNear(expected, 1e-12));
  x.logged.resize(0, 0);
  CHECK_THROWS_WITH(torque_on_rail(spec, x), ContainsSubstring("no logged torque"));
}

TEST_CASE("presliding: Dahl and LuGre follow their equations, through reversals", "[effects]") {
  const Function qd = [](double t) { return 0.2 * std::cos(9.0 * t) + 0.1 * std::sin(4.0 * t); };
  const JointSeries x = rail_series(
      [](double t) { return 0.2 / 9.0 * std::sin(9.0 * t) - 0.1 / 4.0 * std::cos(4.0 * t); }, qd,
      [](double t) { return -1.8 * std::sin(9.0 * t) + 0.4 * std::cos(4.0 * t); });
  SECTION("Dahl") {
    const double F = 3.0, x_s = 0.004;
    const VecX<double> z = integrated(
        [&](double t, double bend) { return qd(t) - std::abs(qd(t)) * bend / x_s; }, 0.0, 50);
    const RowMatX<double> expected = F / x_s * z;
    // Reversals are placed by a straight line between two velocities: 1e-5 of F observed.
    CHECK_THAT(
        torque_on_rail(
            {"presliding_dahl", "slide", {{"coulomb", F, "N"}, {"presliding", x_s, "m"}}}, x),
        MatrixNear(expected, 1e-4));
  }
  SECTION("LuGre") {
    const double s0 = 900.0, s1 = 8.0, Fc = 3.0, Fs = 4.5, vs = 0.05;
    const auto rate = [&](double t) {
      const double g = Fc + (Fs - Fc) * std::exp(-qd(t) * qd(t) / (vs * vs));
      return s0 * std::abs(qd(t)) / g;
    };
    const VecX<double> z =
        integrated([&](double t, double bend) { return qd(t) - rate(t) * bend; }, 0.0, 50);
    RowMatX<double> expected(kRows, 1);
    for (long k = 0; k < kRows; ++k) {
      const double t = static_cast<double>(k) * kDt;
      expected(k, 0) = s0 * z[k] + s1 * (qd(t) - rate(t) * z[k]);
    }
    const EffectSpec spec{"presliding_lugre",
                          "slide",
                          {{"stiffness", s0, "N/m"},
                           {"damping", s1, "N*s/m"},
                           {"coulomb", Fc, "N"},
                           {"stiction", Fs, "N"},
                           {"stribeck_velocity", vs, "m/s"}}};
    CHECK_THAT(torque_on_rail(spec, x), MatrixNear(expected, 1e-3));
  }
}

TEST_CASE("presliding: stiffness without end is dry friction, and stays stable", "[effects]") {
  const JointSeries x = rail_series([](double t) { return -std::cos(9.0 * t) / 9.0; },
                                    [](double t) { return std::sin(9.0 * t); },
                                    [](double t) { return 9.0 * std::cos(9.0 * t); });
  const RowMatX<double> dahl = torque_on_rail(
      {"presliding_dahl", "slide", {{"coulomb", 3.0, "N"}, {"presliding", 1e-9, "m"}}}, x);
  const RowMatX<double> lugre = torque_on_rail({"presliding_lugre",
                                                "slide",
                                                {{"stiffness", 1e9, "N/m"},
                                                 {"coulomb", 3.0, "N"},
                                                 {"stiction", 5.0, "N"},
                                                 {"stribeck_velocity", 0.2, "m/s"}}},
                                               x);
  for (long k = 0; k < kRows; ++k) {
    const double v = x.qd(k, 0);
    if (std::abs(v) < 0.02) continue;  // within two rows of a reversal
    const double sign = v > 0 ? 1.0 : -1.0;
    CHECK(std::abs(dahl(k, 0) - 3.0 * sign) < 1e-9);
    // Steady: Stribeck's curve at the velocity of half a substep ago.
    CHECK(std::abs(lugre(k, 0) - sign * (3.0 + 2.0 * std::exp(-v * v / 0.04))) < 0.01);
  }
}

TEST_CASE("channels: the logged motion with the effect has the torque of the true motion",
          "[effects]") {
  Model model = wam();
  model.effects = {{"armature", "joint2", {{"armature", 0.1, ""}}},
                   {"viscous_friction", "joint1", {{"viscous", 2.0, ""}}},
                   {"coulomb_friction", "joint3", {{"coulomb", 1.0, ""}, {"smoothing", 0.5, ""}}}};
  const ExtendedTree base = extend(model);
  const JointSeries truth = waves();
  const auto required = [&](const JointSeries& x) {
    return inverse_dynamics(base, x.q, x.qd, x.qdd);
  };
  const auto added = [&](const EffectSpec& spec, const JointSeries& x) {
    const BoundEffect e = bind(spec, model);
    return series_torque(e, base, x, e.parameters.data());
  };
  JointSeries logged = truth;
  double tolerance = 1e-10;
  EffectSpec spec;
  SECTION("offset") {
    spec = {"encoder_offset", "joint2", {{"offset", 0.05, "rad"}}};
    logged.q.col(1).array() += 0.05;
  }
  SECTION("scale") {
    spec = {"encoder_scale", "joint4", {{"scale_error", 0.03, "1"}}};
    logged.q.col(3) *= 1.03, logged.qd.col(3) *= 1.03, logged.qdd.col(3) *= 1.03;
  }
  SECTION("time shift") {
    spec = {"time_shift", "all", {{"shift", 4.2e-3, "s"}}};
    logged = waves(-4.2e-3);
    tolerance = 1e-4;
  }
  SECTION("filtered velocity") {
    const double T = 0.01;
    spec = {"velocity_filter_lag", "joint3", {{"lag", T, "s"}}};
    const double w = 9.0, lag = std::atan(w * T), share = 1.0 / std::hypot(1.0, w * T);
    logged.qd.col(2) =
        sampled([&](double t) { return share * 0.6 * w * std::cos(w * t + 2 - lag); });
    logged.qdd.col(2) =
        sampled([&](double t) { return -share * 0.6 * w * w * std::sin(w * t + 2 - lag); });
    tolerance = 1e-5;
  }
  const RowMatX<double> change = required(truth) - required(logged);
  CHECK(change.cwiseAbs().maxCoeff() > 0.05);
  const long rows = kRows - 8;  // beyond the end a shift knows nothing
  CHECK_THAT(added(spec, logged).topRows(rows).eval(), MatrixNear(change.topRows(rows), tolerance));
}

TEST_CASE("base_tilt: a robot on a base that is tilted about x", "[effects]") {
  const double angle = 0.1;
  const Model model = wam();
  Tree<double> tree = make_tree(model), tilted = tree;
  const JointSeries x = waves();
  for (Link<double>& link : tilted.links)
    if (link.parent < 0)
      link.X_PJ = Pose<double>{rotation_about<double>({1, 0, 0}, angle), {0, 0, 0}} * link.X_PJ;
  tree.gravity.z = -9.81 * std::cos(angle);  // the part of the tilt that the effect leaves out
  RneaWorkspace<double, double> ws;
  RowMatX<double> expected(kRows, 4);
  for (long k = 0; k < kRows; ++k) {
    const VecX<double> q = x.q.row(k), qd = x.qd.row(k), qdd = x.qdd.row(k);
    const VecX<double> level = rnea<double, double>(tree, q, qd, qdd, ws);
    expected.row(k) = (rnea<double, double>(tilted, q, qd, qdd, ws) - level).transpose();
  }
  const BoundEffect e = bind(
      {"base_tilt", "base", {{"gravity_x", 0.0, ""}, {"gravity_y", -9.81 * std::sin(angle), ""}}},
      model);
  CHECK(expected.cwiseAbs().maxCoeff() > 0.5);
  CHECK_THAT(series_torque(e, tree, x, e.parameters.data()), MatrixNear(expected, 1e-10));
}

TEST_CASE("tip_force: minus MuJoCo's Jacobian times the force", "[effects]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const RandomArm arm(seed);
  const Mujoco mujoco(arm.tree);
  const int n = arm.tree.num_dofs();
  BoundEffect e;
  e.num_joints = n;
  e.joints = e.links = {n - 1};
  e.type = std::make_shared<const AnyEffect>(TipForce{.p_LF = {0.1, -0.2, 0.3}});
  e.parameter_info = TipForce::info().parameters;
  e.parameters = {3.0, -1.0, 2.0};
  mujoco.scatter(arm.q, mujoco.data->qpos);
  mj_forward(mujoco.model.get(), mujoco.data.get());
  const int body =
      mj_name2id(mujoco.model.get(), mjOBJ_BODY, ("b" + std::to_string(n - 1)).c_str());
  const mjtNum* R = mujoco.data->xmat + 9 * body;
  mjtNum point[3];
  for (int i = 0; i < 3; ++i)
    point[i] =
        mujoco.data->xpos[3 * body + i] + R[3 * i] * 0.1 + R[3 * i + 1] * -0.2 + R[3 * i + 2] * 0.3;
  std::vector<mjtNum> J(static_cast<std::size_t>(3 * n)), tau(static_cast<std::size_t>(n));
  mj_jac(mujoco.model.get(), mujoco.data.get(), J.data(), nullptr, point, body);
  for (int i = 0; i < n; ++i) tau[i] = -(J[i] * 3.0 + J[n + i] * -1.0 + J[2 * n + i] * 2.0);
  JointSeries x;
  x.dt = kDt;
  x.q = arm.q.transpose(), x.qd = arm.qd.transpose(), x.qdd = arm.qdd.transpose();
  CHECK_THAT(series_torque(e, arm.tree, x, e.parameters.data()).row(0).transpose().eval(),
             MatrixNear(mujoco.gather(tau.data()), 1e-10));
}

TEST_CASE("tip_force: pulls at the frame `tip`, else at what is fixed to the last link",
          "[effects]") {
  const auto point = [](const Model& m) {
    return std::get<TipForce>(*bind({"tip_force", "tip", {}}, m).type).p_LF;
  };
  Model m = rail();
  m.links[0].inertia.h = {0.2, 0.0, 0.0};
  CHECK(point(m).x == 0.1);  // centre of mass
  ModelLink hand;
  hand.name = "hand";
  hand.parent = 0;
  hand.X_PJ.p = {0.0, 0.7, 0.0};
  m.links.push_back(hand);
  CHECK(point(m).y == 0.7);
  m.frames = {{"tip", 1, {Mat3<double>::identity(), {0.0, 0.0, 0.5}}}, {"other", 0, {}}};
  CHECK(point(m).y == 0.7);
  CHECK(point(m).z == 0.5);
}

TEST_CASE("series: effects of one instant are add_torque's, row by row, over the time of the run",
          "[effects]") {
  const Model model = wam();
  JointSeries x = waves();
  x.start = 30.0;
  const Tree<double> tree = make_tree(model);
  const BoundEffect e =
      bind({"warm_up", "joint1", {{"viscous", 2.0, ""}, {"time_constant", 20.0, ""}}}, model);
  const RowMatX<double> torque = series_torque(e, tree, x, e.parameters.data());
  for (const long k : {0L, 1000L})
    CHECK(std::abs(torque(k, 0) - 2.0 * std::exp(-(30.0 + 1e-3 * static_cast<double>(k)) / 20.0) *
                                      x.qd(k, 0)) < 1e-12);
  CHECK(torque.rightCols(3).isZero());
}

TEST_CASE("series: shapes that do not fit are said", "[effects]") {
  const Model model = wam();
  const BoundEffect e = bind({"viscous_friction", "joint1", {}}, model);
  JointSeries x = waves();
  x.tau.resize(3, 4);
  CHECK_THROWS_AS(series_torque(e, make_tree(model), x, e.parameters.data()), ShapeError);
  x = waves();
  x.dt = 0.0;
  CHECK_THROWS_WITH(series_torque(e, make_tree(model), x, e.parameters.data()),
                    ContainsSubstring("dt"));
  x = waves();
  CHECK_THROWS_AS(series_columns(e, make_tree(model), x, e.parameters.data(), {1}), ShapeError);
  CHECK_THROWS_AS(series_torque(e, make_tree(rail()), x, e.parameters.data()), ShapeError);
}

}  // namespace effects_series_test
