/// Derivatives of simulated windows against central differences, and friction too steep for the
/// time between rows.

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/sim/record.hpp>

#include "motion/free_swing.hpp"
#include "motion/joint_windows.hpp"

namespace sensitivities_test {

using namespace diffnea;
using Catch::Approx;

namespace {

Model arm(double smoothing) {
  Model model = read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/double_pendulum.urdf");
  for (const char* joint : {"shoulder", "elbow"}) {
    model.effects.push_back(
        {"coulomb_friction", joint, {{"coulomb", 0.1, ""}, {"smoothing", smoothing, ""}}});
    model.effects.push_back({"viscous_friction", joint, {{"viscous", 0.03, ""}}});
  }
  return model;
}

std::vector<BoundEffect> bound(const Model& model) {
  std::vector<BoundEffect> out;
  for (const EffectSpec& spec : model.effects) out.push_back(bind(spec, model));
  return out;
}

MotionStretch stretch_of(const Model& model) {
  FourierOptions motion;
  motion.duration = 2.0;
  motion.seed = 4;
  RecordOptions options;
  options.position_noise = options.torque_noise = 0.0;
  const Recording r = record_model(model, model, random_fourier(model, motion), options).recording;
  return motion_stretches(r, sensor_noise({r}, {false, false}), {false, false}).at(0);
}

/// Compares the rows that a simulator gives, by their Gram matrix, with residuals moved by ±1e-7.
/// @param moved  moved(column, by): residuals with one of the columns moved; column −1: none
template <class Moved>
void check_rows(const TriangularFactor& rows, int columns, const Moved& moved) {
  const VecX<double> at = moved(-1, 0.0);
  MatX<double> J(at.size(), columns + 1);
  for (int c = 0; c < columns; ++c) J.col(c) = (moved(c, 1e-7) - moved(c, -1e-7)) / 2e-7;
  J.col(columns) = at;
  MatX<double> R = MatX<double>::Zero(columns + 1, columns + 1);
  R.topLeftCorner(columns, columns) = rows.R();
  R.topRightCorner(columns, 1) = rows.d();
  R(columns, columns) = std::sqrt(rows.residual_sum_of_squares());
  const MatX<double> gram = R.transpose() * R, expected = J.transpose() * J;
  /// Central difference, h = 1e-7: what positions of 15 digits leave. A larger h would move kinks
  /// of friction across stages of the steps.
  constexpr double kTol = 1e-5;
  for (int i = 0; i <= columns; ++i)
    for (int k = 0; k <= columns; ++k) {
      CAPTURE(i, k);
      CHECK(std::abs(gram(i, k) - expected(i, k)) <
            kTol * std::sqrt(expected(i, i) * expected(k, k)));
    }
}

/// Residuals of a window, one after the other.
VecX<double> residuals(const Model& model, const MotionStretch& s, const MotionWindow& w) {
  JointWindows simulator(extend(model), bound(model), {}, {});
  const RowMatX<double> e = simulator.positions(s, w) - s.q.middleRows(w.first, w.rows);
  return e.reshaped<Eigen::RowMajor>();
}

}  // namespace

TEST_CASE("sensitivities: first state, inertia, friction and its shape, by central differences",
          "[motion]") {
  const Model model = arm(0.2);
  const MotionStretch s = stretch_of(model);
  MotionWindow w{0, 40, 150, VecX<double>(4)};
  w.state << s.q(40, 0) + 0.01, s.q(40, 1), 0.3, -0.2;
  // mass and h_z of the lower link, Coulomb and its ln v₀ at the shoulder, viscous at the elbow
  const std::vector<MotionParameter> free{{.dof = 1, .theta = 0},
                                          {.dof = 1, .theta = 3},
                                          {.effect = 0, .index = 0},
                                          {.effect = 0, .index = 1, .logarithmic = true},
                                          {.effect = 3, .index = 0}};
  JointWindows simulator(extend(model), bound(model), free, {});
  TriangularFactor rows(9);
  REQUIRE(simulator.linearise(s, w, VecX<double>::Ones(2), rows));
  check_rows(rows, 9, [&](int column, double by) {
    Model m = model;
    MotionWindow at = w;
    if (column >= 0 && column < 4) at.state[column] += by;
    ModelLink& lower = m.links[static_cast<std::size_t>(moving_links(m)[1])];
    if (column == 4) lower.inertia.m += by;
    if (column == 5) lower.inertia.h.z += by;
    if (column == 6) m.effects[0].parameters[0].value += by;
    if (column == 7) m.effects[0].parameters[1].value *= std::exp(by);
    if (column == 8) m.effects[3].parameters[0].value += by;
    return residuals(m, s, at);
  });
}

TEST_CASE("sensitivities: limbs that nothing ties together, each with columns of its own",
          "[motion]") {
  // Two arms on one stand; names of the second one's end with a 2.
  Model model = arm(0.2);
  const int links = static_cast<int>(model.links.size());
  for (int i = 1; i < links; ++i) {
    ModelLink link = model.links[static_cast<std::size_t>(i)];
    link.name += "2";
    link.joint += "2";
    if (link.parent > 0) link.parent += links - 1;
    model.links.push_back(link);
  }
  const std::size_t effects = model.effects.size();
  for (std::size_t e = 0; e < effects; ++e) {
    EffectSpec spec = model.effects[e];
    spec.where += "2";
    spec.parameters[0].value *= 2.0;
    model.effects.push_back(spec);
  }
  const ExtendedTree plain = extend(model);
  const std::vector<Limb> apart = limbs(plain, bound(model));
  REQUIRE(apart.size() == 2);
  CHECK((apart[0].first == 0 && apart[0].count == 2));
  CHECK((apart[1].first == 2 && apart[1].count == 2));
  const ExtendedTree second = LimbPart(plain.tree, apart[1]).model(plain);
  CHECK(second.tree.links[1].parent == 0);
  CHECK(second.effects.size() == effects);
  Model tied = model;
  tied.effects.push_back({"transmission_coupling", "elbow,shoulder2", {}});
  CHECK(limbs(extend(tied), bound(tied)).size() == 1);

  const MotionStretch s = stretch_of(model);
  MotionWindow w{0, 40, 100, VecX<double>(8)};
  w.state << s.q.row(40).transpose(), 0.3, -0.2, 0.1, 0.4;
  // One of the second arm first: columns come in the order of the parameters.
  const std::vector<MotionParameter> free{{.dof = 3, .theta = 0},
                                          {.effect = 0, .index = 0},
                                          {.effect = 4, .index = 1, .logarithmic = true},
                                          {.effect = 3, .index = 0}};
  JointWindows simulator(extend(model), bound(model), free, {});
  TriangularFactor rows(12);
  REQUIRE(simulator.linearise(s, w, VecX<double>::Ones(4), rows));
  check_rows(rows, 12, [&](int column, double by) {
    Model m = model;
    MotionWindow at = w;
    if (column >= 0 && column < 8) at.state[column] += by;
    if (column == 8) m.links.back().inertia.m += by;
    if (column == 9) m.effects[0].parameters[0].value += by;
    if (column == 10) m.effects[4].parameters[1].value *= std::exp(by);
    if (column == 11) m.effects[3].parameters[0].value += by;
    return residuals(m, s, at);
  });
}

TEST_CASE("sensitivities: a servo whose friction follows its load, by central differences",
          "[motion]") {
  Model model = test::swing_model();
  const std::string joint = "pendulum";
  model.effects = {{"position_servo", joint, {{"stiffness", 3.0, ""}, {"damping", 0.1, ""}}},
                   {"load_friction",
                    joint,
                    {{"mu", 0.3, ""}, {"braking_ratio", 0.6, ""}, {"smoothing", 0.5, ""}}},
                   {"armature", joint, {{"armature", 0.004, ""}}}};
  MotionStretch s;
  const long n = 200;
  RowMatX<double> command(n, 1);
  for (long k = 0; k < n; ++k) {
    const double t = 0.01 * static_cast<double>(k);
    s.time.push_back(t);
    command(k, 0) = std::sin(4.0 * t * t);
  }
  s.q = RowMatX<double>::Zero(n, 1);
  s.u = s.u_end = RowMatX<double>::Zero(n, 1);
  s.command = std::make_shared<const CommandPath>(s.time, command, VecX<double>::Ones(1));
  MotionWindow w{0, 0, n, VecX<double>(2)};
  w.state << 0.2, -0.3;
  const std::vector<MotionParameter> free{{.dof = 0, .theta = 7},
                                          {.dof = 0, .theta = 3},
                                          {.effect = 0, .index = 0},
                                          {.effect = 1, .index = 0},
                                          {.effect = 1, .index = 1, .logarithmic = true},
                                          {.effect = 1, .index = 2, .logarithmic = true},
                                          {.effect = 2, .index = 0}};
  JointWindows simulator(extend(model), bound(model), free, {});
  TriangularFactor rows(9);
  REQUIRE(simulator.linearise(s, w, VecX<double>::Ones(1), rows));
  check_rows(rows, 9, [&](int column, double by) {
    Model m = model;
    MotionWindow at = w;
    if (column == 0 || column == 1) at.state[column] += by;
    ModelLink& link = m.links[static_cast<std::size_t>(moving_links(m)[0])];
    if (column == 2) link.inertia.I.yy += by;
    if (column == 3) link.inertia.h.z += by;
    if (column == 4) m.effects[0].parameters[0].value += by;
    if (column == 5) m.effects[1].parameters[0].value += by;
    if (column == 6 || column == 7)
      m.effects[1].parameters[static_cast<std::size_t>(column - 5)].value *= std::exp(by);
    if (column == 8) m.effects[2].parameters[0].value += by;
    return residuals(m, s, at);
  });
}

namespace {

/// The pendulum led by a servo in steps of its command, of which most saturate it.
MotionStretch stepped(const std::vector<double>& steps, double rate) {
  constexpr double kEach = 0.25;  // [s] that a step takes
  const long n = std::lround(rate * kEach) * static_cast<long>(steps.size());
  MotionStretch s;
  RowMatX<double> command(n, 1);
  for (long k = 0; k < n; ++k) {
    s.time.push_back(static_cast<double>(k) / rate);
    command(k, 0) = steps[static_cast<std::size_t>((s.time.back() + 1e-9) / kEach)];
  }
  s.q = RowMatX<double>::Zero(n, 1);
  s.u = s.u_end = s.q;
  s.command = std::make_shared<const CommandPath>(s.time, command, VecX<double>::Ones(1));
  return s;
}

Model servo_that_saturates() {
  Model model = test::swing_model();
  model.effects = {
      {"position_servo",
       "pendulum",
       {{"stiffness", 30.0, ""}, {"damping", 0.1, ""}, {"delay", 0.013, ""}, {"reach", 0.03, ""}}},
      {"armature", "pendulum", {{"armature", 0.004, ""}}}};
  return model;
}

}  // namespace

TEST_CASE("sensitivities: delay and reach of a servo that saturates, by central differences",
          "[motion]") {
  const Model model = servo_that_saturates();
  const MotionStretch s = stepped({0.7, -0.6, 0.4, -0.9}, 100.0);
  MotionWindow w{0, 0, static_cast<long>(s.time.size()), VecX<double>(2)};
  w.state << 0.2, -0.3;
  const std::vector<MotionParameter> free{{.effect = 0, .index = 0},
                                          {.effect = 0, .index = 2},
                                          {.effect = 0, .index = 3, .logarithmic = true}};
  JointWindows simulator(extend(model), bound(model), free, {});
  TriangularFactor rows(5);
  REQUIRE(simulator.linearise(s, w, VecX<double>::Ones(1), rows));
  check_rows(rows, 5, [&](int column, double by) {
    Model m = model;
    MotionWindow at = w;
    if (column == 0 || column == 1) at.state[column] += by;
    std::vector<EffectParameter>& servo = m.effects[0].parameters;
    if (column == 2) servo[0].value += by;
    if (column == 3) servo[2].value += by;
    if (column == 4) servo[3].value *= std::exp(by);
    return residuals(m, s, at);
  });
}

TEST_CASE(
    "limbs: a servo beside another moves as it does alone, and a window's parts are the window",
    "[motion]") {
  const auto servo = [](double scale) {
    Model model = servo_that_saturates();
    model.effects[0].parameters[0].value *= scale;
    model.effects.push_back({"integral_action", "pendulum", {{"rate", 2.0 * scale, ""}}});
    model.effects.push_back({"coulomb_friction", "pendulum", {{"coulomb", 0.02, ""}}});
    return model;
  };
  const Model one = servo(1.0), other = servo(0.5);
  Model two = one;
  two.links.push_back(other.links.back());
  two.links.back().name += "2";
  two.links.back().joint += "2";
  for (EffectSpec spec : other.effects) {
    spec.where += "2";
    two.effects.push_back(spec);
  }
  const auto alone = [](MotionStretch s, double speed) {
    for (long k = 0; k < s.q.rows(); ++k)
      s.q(k, 0) = std::sin(speed * s.time[static_cast<std::size_t>(k)]);
    return s;
  };
  const std::vector<double> a{0.7, -0.6, 0.4, -0.9}, b{-0.3, 0.2, 0.8, 0.1};
  const MotionStretch first = alone(stepped(a, 100.0), 3.0), second = alone(stepped(b, 100.0), 5.0);
  MotionStretch both = first;
  const long n = static_cast<long>(both.time.size());
  both.q.conservativeResize(n, 2);
  both.q.col(1) = second.q.col(0);
  both.u = both.u_end = RowMatX<double>::Zero(n, 2);
  RowMatX<double> command(n, 2);
  for (long k = 0; k < n; ++k)
    for (const int j : {0, 1})
      command(k, j) = (j == 0 ? first : second)
                          .command->at(0, both.time[static_cast<std::size_t>(k)] + 1e-9, 0.0);
  both.command = std::make_shared<const CommandPath>(both.time, command, VecX<double>::Ones(2));
  MotionWindow w{0, 30, 60, VecX<double>(4)}, w1{0, 30, 60, VecX<double>(2)}, w2 = w1;
  w.state << 0.2, -0.1, -0.3, 0.4;
  w1.state << 0.2, -0.3;
  w2.state << -0.1, 0.4;
  const std::vector<MotionParameter> free{{.effect = 4, .index = 0}, {.effect = 0, .index = 0}};
  JointWindows pair(extend(two), bound(two), free, {}), left(extend(one), {}, {}, {}),
      right(extend(other), {}, {}, {});
  const RowMatX<double> q = pair.positions(both, w);
  CHECK(q.col(0) == left.positions(first, w1).col(0));
  CHECK(q.col(1) == right.positions(second, w2).col(0));
  const VecX<double> sigma{{0.1, 0.2}};
  CHECK(pair.cost(both, w, sigma) ==
        Approx(left.cost(first, w1, sigma.head(1)) + right.cost(second, w2, sigma.tail(1))));
  TriangularFactor whole(6), together(6);
  REQUIRE(pair.linearise(both, w, sigma, whole));
  std::vector<TriangularFactor> parts(7, TriangularFactor(6));
  REQUIRE(pair.linearise(both, w, sigma, parts));
  for (const TriangularFactor& part : parts) {
    CHECK(part.residual_sum_of_squares() < whole.residual_sum_of_squares());
    together.add(part);
  }
  CHECK(
      (together.R().transpose() * together.R()).isApprox(whole.R().transpose() * whole.R(), 1e-10));
  CHECK(together.residual_sum_of_squares() == Approx(whole.residual_sum_of_squares()));
}

TEST_CASE("sensitivities: of a joint at rest, by friction that turns within 1e-10 rad/s",
          "[motion]") {
  Model model = servo_that_saturates();
  model.effects[0].parameters[3].value = 1e3;
  model.effects.push_back(
      {"coulomb_friction", "pendulum", {{"coulomb", 0.5, ""}, {"smoothing", 1e-10, ""}}});
  const MotionStretch s = stepped({0.3, 0.31, 0.305, 0.0}, 100.0);
  MotionWindow w{0, 0, static_cast<long>(s.time.size()), VecX<double>(2)};
  w.state << 0.3, 0.0;
  const std::vector<MotionParameter> free{{.effect = 0, .index = 0}, {.effect = 1, .index = 0}};
  JointWindows simulator(extend(model), bound(model), free, {});
  TriangularFactor rows(4);
  REQUIRE(simulator.linearise(s, w, VecX<double>::Ones(1), rows));
  // Explicit steps longer than the slope allows leave no number, or 1e30.
  CHECK(rows.R().cwiseAbs().maxCoeff() < 1e6);
}

TEST_CASE(
    "path: a servo that saturates where its window begins moves as in a log ten times as fast",
    "[motion]") {
  Model model = servo_that_saturates();
  model.effects[0].parameters[0].value = 300.0;
  model.effects[0].parameters[3].value = 0.003;
  JointWindows simulator(extend(model), bound(model), {}, {});
  const std::vector<double> steps{0.7, 0.71, 0.69, 0.7};
  const MotionStretch coarse = stepped(steps, 100.0), fine = stepped(steps, 1000.0);
  MotionWindow w{0, 0, static_cast<long>(coarse.time.size()), VecX<double>(2)};
  w.state << 0.0, 0.0;
  const RowMatX<double> q = simulator.positions(coarse, w);
  w.rows = static_cast<long>(fine.time.size());
  const RowMatX<double> exact = simulator.positions(fine, w);
  double worst = 0.0;
  for (long k = 0; k < q.rows(); ++k) worst = std::max(worst, std::abs(q(k, 0) - exact(10 * k, 0)));
  // A row is more than a radian of the swing at full gain: as one step, it would not end.
  CHECK(worst < 1e-3);
}

TEST_CASE("path: a gear that locks itself stays where it comes to rest", "[motion]") {
  // mu > 1; no friction at all where the pendulum hangs, and far too steep a one elsewhere.
  Model model = test::swing_model();
  const std::string joint = "pendulum";
  model.effects = {{"load_friction", joint, {{"mu", 1.3, ""}, {"smoothing", 1e-4, ""}}},
                   {"armature", joint, {{"armature", 0.01, ""}}}};
  const Recording r = test::free_swing({}, test::even_times(0.0, 5.0, 100.0));
  const MotionStretch s = motion_stretches(r, sensor_noise({r}, {true}), {true}).at(0);
  MotionWindow w{0, 0, static_cast<long>(s.time.size()), VecX<double>(2)};
  JointWindows simulator(extend(model), bound(model), {}, {});
  w.state << 1.0, 0.0;
  const RowMatX<double> held = simulator.positions(s, w);
  REQUIRE(held.allFinite());
  // It creeps at the speed where 1.3 tanh(q̇/v₀) = 1.
  CHECK(std::abs(held(held.rows() - 1, 0) - 1.0) < 1.1 * 1e-4 * std::atanh(1.0 / 1.3) * 5.0);
  w.state << 0.0, 3.0;
  const RowMatX<double> thrown = simulator.positions(s, w);
  REQUIRE(thrown.allFinite());
  // Going up, (J_a + 2.3 J) q̈ = −2.3 g sin q until it stops.
  const double J = test::kSwingInertia, top = 1.0 - (0.01 + 2.3 * J) * 4.5 / (2.3 * test::kSwingGravity);
  CHECK(thrown.maxCoeff() == Approx(std::acos(top)).epsilon(1e-3));
  CHECK(std::abs(thrown(thrown.rows() - 1, 0) - thrown.maxCoeff()) < 1e-3);
  TriangularFactor rows(2);
  CHECK(simulator.linearise(s, w, VecX<double>::Ones(1), rows));
  CHECK(rows.R().allFinite());
}

TEST_CASE(
    "path: dry friction that is steep within a row neither blows up nor moves a joint at rest",
    "[motion]") {
  // 0.05 N·m on 0.007 kg·m² would stop 0.07 rad/s within a row of 10 ms; the slope at rest is
  // 5000 times what an explicit step stands.
  test::FreeSwing swing;
  Model model = test::swing_model();
  model.effects.push_back(
      {"coulomb_friction", "pendulum", {{"coulomb", 0.05, ""}, {"smoothing", 1e-5, ""}}});
  const Recording r = test::free_swing(swing, test::even_times(0.0, 10.0, 100.0));
  const MotionStretch s = motion_stretches(r, sensor_noise({r}, {true}), {true}).at(0);
  MotionWindow w{0, 0, static_cast<long>(s.time.size()), VecX<double>(2)};
  w.state << 1.0, 0.0;
  JointWindows simulator(extend(model), bound(model), {}, {});
  const RowMatX<double> q = simulator.positions(s, w);
  REQUIRE(q.allFinite());
  // It comes to rest where gravity is below the friction, sin q < 0.05/0.241, and stays.
  const long n = q.rows();
  CHECK(std::abs(q(n - 1, 0)) < std::asin(0.05 / test::kSwingGravity));
  CHECK(std::abs(q(n - 1, 0) - q(n / 2, 0)) < 1e-3);
  // Energy: the way times the friction is what gravity gave.
  double way = 0.0;
  for (long k = 1; k < n; ++k) way += std::abs(q(k, 0) - q(k - 1, 0));
  const double lost = test::kSwingGravity * (std::cos(q(n - 1, 0)) - std::cos(1.0));
  CHECK(0.05 * way == Approx(lost).epsilon(0.02));  // steps of 1/8 row around each reversal
  TriangularFactor rows(2);
  CHECK(simulator.linearise(s, w, VecX<double>::Ones(1), rows));
  CHECK(rows.R().allFinite());
}

TEST_CASE("path: a joint breaks away and stops within a row as dry friction that is sharp has it",
          "[motion]") {
  // No gravity: under a constant torque it gains speed evenly, without one it loses it so.
  constexpr double kFriction = 0.05, kTorque = 0.08, kJ = test::kSwingInertia;
  constexpr long kPushed = 10;  // rows that begin with the torque
  Model model = test::swing_model();
  model.gravity = {0.0, 0.0, 0.0};
  model.effects = {
      {"coulomb_friction", "pendulum", {{"coulomb", kFriction, ""}, {"smoothing", 1e-5, ""}}}};
  Recording r = test::free_swing({}, test::even_times(0.0, 0.5, 100.0));
  r.info.passive.clear();
  r.has_tau = {true};
  r.tau.topRows(kPushed).setConstant(kTorque);
  MotionStretch s = motion_stretches(r, sensor_noise({r}, {false}), {false}).at(0);
  s.u.setZero();
  s.u.topRows(kPushed).setConstant(kTorque);
  s.u_end = s.u;  // held from row to row
  const double h = s.time[1] - s.time[0], pushed = h * kPushed, gain = (kTorque - kFriction) / kJ,
               speed = gain * pushed, stops = pushed + speed / (kFriction / kJ);
  const auto exact = [&](double t) {
    if (t < pushed) return 0.5 * gain * t * t;
    const double left = std::min(t, stops) - pushed;
    return 0.5 * gain * pushed * pushed + speed * left - 0.5 * kFriction / kJ * left * left;
  };
  const MotionWindow w{0, 0, static_cast<long>(s.time.size()), VecX<double>::Zero(2)};
  JointWindows simulator(extend(model), bound(model), {}, {});
  const RowMatX<double> q = simulator.positions(s, w);
  REQUIRE(stops < s.time.back() - s.time.front() - 5.0 * h);
  /// Share of the way: speeds of 1e-5 rad/s at which friction turns, over 0.4 rad/s, and steps that
  /// halve the speed at most around the two instants.
  constexpr double kTol = 1e-3;
  for (long k = 0; k < q.rows(); ++k) {
    CAPTURE(k);
    CHECK(std::abs(q(k, 0) - exact(s.time[static_cast<std::size_t>(k)] - s.time[0])) <
          kTol * exact(stops));
  }
}

TEST_CASE("path: friction of one direction alone holds a joint against a push that way",
          "[motion]") {
  constexpr double kFriction = 50.0, kTorque = 0.08, kSharp = 1e-5;
  constexpr long kHeld = 25;  // rows that push towards the side of the friction
  Model model = test::swing_model();
  model.gravity = {0.0, 0.0, 0.0};
  model.effects = {{"asymmetric_coulomb",
                    "pendulum",
                    {{"coulomb_positive", 0.0, ""},
                     {"coulomb_negative", kFriction, ""},
                     {"smoothing", kSharp, ""}}}};
  Recording r = test::free_swing({}, test::even_times(0.0, 0.5, 100.0));
  MotionStretch s = motion_stretches(r, sensor_noise({r}, {false}), {false}).at(0);
  s.u.setConstant(kTorque);
  s.u.topRows(kHeld).setConstant(-kTorque);
  s.u_end = s.u;  // held from row to row
  const double h = s.time[1] - s.time[0];
  const MotionWindow w{0, 0, static_cast<long>(s.time.size()), VecX<double>::Zero(2)};
  JointWindows simulator(extend(model), bound(model), {}, {});
  const RowMatX<double> q = simulator.positions(s, w);
  for (long k = 0; k < q.rows(); ++k) {
    CAPTURE(k);
    const double pushed = h * static_cast<double>(std::max(k - kHeld, 0L)),
                 exact = 0.5 * kTorque / test::kSwingInertia * pushed * pushed;
    // Held, it creeps by no more than the speed at which friction turns.
    CHECK(std::abs(q(k, 0) - exact) < kSharp * h * static_cast<double>(q.rows()));
  }
}

}  // namespace sensitivities_test
