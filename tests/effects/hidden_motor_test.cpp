/// What turns behind the encoder: a rotor on its spring, or in the gap of its gear, in closed form.

#include <cmath>
#include <complex>
#include <numbers>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/effects/series.hpp>

#include "support/joint_waves.hpp"
#include "support/matrix_near.hpp"

namespace hidden_motor_test {

using namespace diffnea;
using namespace diffnea::test;

TEST_CASE("joint_elasticity: rotor on a damped spring, in closed form", "[effects]") {
  // τ = A sin ωt: θ − q lags behind it as K δ + D δ̇ = τ says.
  const double K = 4000.0, D = 20.0, J = 0.3, A = 50.0, w = 25.0;
  JointSeries x = rail_at_rest();
  x.tau = sampled([&](double t) { return A * std::sin(w * t); });
  const double size = A / std::hypot(K, D * w), phase = std::atan2(D * w, K);
  const RowMatX<double> expected =
      sampled([&](double t) { return -J * w * w * size * std::sin(w * t - phase); });
  const RowMatX<double> torque = torque_on_rail(
      {"joint_elasticity",
       "slide",
       {{"stiffness", K, "N/m"}, {"damping", D, "N*s/m"}, {"motor_inertia", J, "kg"}}},
      x);
  const long first = 100;  // 20 time constants D/K: it began at rest on its ramp
  CHECK(expected.cwiseAbs().maxCoeff() > 2.0);
  CHECK_THAT(torque.bottomRows(kRows - first).topRows(kRows - first - 3).eval(),
             MatrixNear(expected.bottomRows(kRows - first).topRows(kRows - first - 3), 2e-3));
}

TEST_CASE("joint_elasticity: a link behind its motor's encoder, in closed form", "[effects]") {
  // θ = A sin ωt is logged: q = A Re[−i e^{iωt} (K + iωD)/(K + iωD − M ω²)].
  const double K = 4000.0, D = 100.0, M = 2.0, A = 0.2, w = 25.0;
  const std::complex<double> spring(K, w * D), link = A * spring / (spring - M * w * w);
  const JointSeries x = rail_series([=](double t) { return A * std::sin(w * t); },
                                    [=](double t) { return A * w * std::cos(w * t); },
                                    [=](double t) { return -A * w * w * std::sin(w * t); });
  const RowMatX<double> expected = sampled(
      [=](double t) { return -M * w * w * std::imag((link - A) * std::polar(1.0, w * t)); });
  const double inertia = GENERATE(0.0, 0.3);  // the motor's moves as logged
  const RowMatX<double> torque = torque_on_rail({"joint_elasticity",
                                                 "slide",
                                                 {{"stiffness", K, "N/m"},
                                                  {"damping", D, "N*s/m"},
                                                  {"motor_inertia", inertia, "kg"},
                                                  {"encoder_side", 1.0, "1"}}},
                                                x);
  const long edge = 600;  // how it swings at first fades by e^−15
  CHECK(expected.cwiseAbs().maxCoeff() > 50.0);  // [N], not far from the spring's frequency
  CHECK_THAT(torque.middleRows(edge, kRows - 2 * edge).eval(),
             MatrixNear(expected.middleRows(edge, kRows - 2 * edge).eval(), 0.05));
}

TEST_CASE("joint_elasticity: behind its motor's encoder a link of inertia below zero moves as logged",
          "[effects]") {
  // A linear fit may leave such a base; on a spring it would swing ever wider.
  JointSeries x = rail_series([](double t) { return std::sin(t); },
                              [](double t) { return std::cos(t); },
                              [](double t) { return -std::sin(t); });
  x.inertia = RowMatX<double>::Constant(kRows, 1, -0.5);
  const RowMatX<double> torque =
      torque_on_rail({"joint_elasticity",
                      "slide",
                      {{"stiffness", 4000.0, "N/m"}, {"encoder_side", 1.0, "1"}}},
                     x);
  CHECK(torque.cwiseAbs().maxCoeff() == 0.0);
}

TEST_CASE("joint_elasticity: what swings behind its encoder when the log begins swings on",
          "[effects]") {
  // The motion above, and B e^{zt} of the spring's own, z² M + z D + K = 0, which fades by e^−1.
  const double K = 4000.0, D = 2.0, M = 2.0, A = 0.05, B = 0.01, w = 12.0;
  const std::complex<double> spring(K, w * D), link = A * spring / (spring - M * w * w);
  const double fades = D / (2.0 * M);
  const std::complex<double> z(-fades, std::sqrt(K / M - fades * fades));
  JointSeries x = rail_series([=](double t) { return A * std::sin(w * t); },
                              [=](double t) { return A * w * std::cos(w * t); },
                              [=](double t) { return -A * w * w * std::sin(w * t); });
  const RowMatX<double> expected = sampled([=](double t) {
    return -M * (w * w * std::imag((link - A) * std::polar(1.0, w * t)) +
                 std::real(B * z * z * std::exp(z * t)));
  });
  x.logged = expected + sampled([=](double t) { return M * (9.81 - A * w * w * std::sin(w * t)); });
  const RowMatX<double> torque = torque_on_rail({"joint_elasticity",
                                                 "slide",
                                                 {{"stiffness", K, "N/m"},
                                                  {"damping", D, "N*s/m"},
                                                  {"encoder_side", 1.0, "1"}}},
                                                x);
  const double largest = expected.cwiseAbs().maxCoeff();
  CHECK(largest > 30.0);
  // One-sided differences at the ends, which the first state is told by as well: 2 % of it.
  const long edge = 4;
  CHECK_THAT(torque.middleRows(edge, kRows - 2 * edge).eval(),
             MatrixNear(expected.middleRows(edge, kRows - 2 * edge).eval(), 0.02 * largest));
}

TEST_CASE("joint_elasticity: what else a model lacks when the log begins swings nothing",
          "[effects]") {
  // The motion above without its free swing, beside a torque that the model does not have: over one
  // period of the spring it looks like a start, which would swing on; over all that lasts, it does
  // not.
  const double K = 4000.0, D = 2.0, M = 2.0, A = 0.05, w = 12.0;
  const std::complex<double> spring(K, w * D), link = A * spring / (spring - M * w * w);
  JointSeries x = rail_series([=](double t) { return A * std::sin(w * t); },
                              [=](double t) { return A * w * std::cos(w * t); },
                              [=](double t) { return -A * w * w * std::sin(w * t); });
  const RowMatX<double> expected = sampled(
      [=](double t) { return -M * w * w * std::imag((link - A) * std::polar(1.0, w * t)); });
  x.logged = expected + sampled([=](double t) {
               return M * (9.81 - A * w * w * std::sin(w * t)) + std::sin(3.0 * t);
             });
  const RowMatX<double> torque = torque_on_rail(
      {"joint_elasticity",
       "slide",
       {{"stiffness", K, "N/m"}, {"damping", D, "N*s/m"}, {"encoder_side", 1.0, "1"}}},
      x);
  const double largest = expected.cwiseAbs().maxCoeff();
  const long edge = 4;
  CHECK_THAT(torque.middleRows(edge, kRows - 2 * edge).eval(),
             MatrixNear(expected.middleRows(edge, kRows - 2 * edge).eval(), 0.02 * largest));
}

TEST_CASE("backlash: the rotor flies across the gap and comes to rest at the other flank",
          "[effects]") {
  const double gap = 0.02, J = 0.4, A = 20.0, w = 3.0;
  const double restitution = GENERATE(0.0, 0.5);
  JointSeries x = rail_at_rest();
  x.logged = sampled([&](double t) { return A * std::sin(w * t); });
  // The torque leaves the flank at π/w; the flight ends where A/(J w²) (w s − sin w s) is the gap.
  double s = 0.0;
  while (A / (J * w * w) * (w * s - std::sin(w * s)) < gap) s += 1e-6;
  const long leaves = std::lround(std::numbers::pi / w / x.dt);
  const long hits = static_cast<long>((std::numbers::pi / w + s) / x.dt);
  // Something holds the link against the teeth.
  x.tau = x.logged;
  x.tau.middleRows(leaves, hits - leaves).setZero();
  const BoundEffect effect =
      bind({"backlash",
            "slide",
            {{"gap", gap, "m"}, {"motor_inertia", J, "kg"}, {"restitution", restitution, "1"}}},
           rail());
  const VecX<double> torque =
      series_torque(effect, make_tree(rail()), x, effect.parameters.data()).col(0);
  // Each step takes its mean torque: order two in dt.
  CHECK(torque.head(leaves - 2).isZero(0.0));
  CHECK(hits - leaves > 20);
  for (long k = leaves + 2; k < hits - 1; ++k)
    CHECK_THAT(torque[k], Catch::Matchers::WithinAbs(x.logged(k, 0), 1e-3));
  // At rest again well before the torque changes back: no momentum is left, and the rotor has moved
  // by the gap.
  const long rest = static_cast<long>(1.9 * std::numbers::pi / w / x.dt);
  double momentum = 0.0, moved = 0.0;
  for (long k = 0; k < rest; ++k) {
    momentum += torque[k] * x.dt;
    moved += momentum / J * x.dt;
  }
  CHECK_THAT(momentum, Catch::Matchers::WithinAbs(0.0, 1e-9));
  CHECK_THAT(moved, Catch::Matchers::WithinAbs(-gap, 2e-3 * gap + 2.0 * x.dt * x.dt * A / J));
}

TEST_CASE("backlash: behind its motor's encoder the link flies on when the motor brakes",
          "[effects]") {
  // θ = −A cos wt is logged. At its middle the motor begins to brake; the link, of mass M and with
  // nothing else to hold it, goes on at the speed A w until A (w s − sin w s) is the gap.
  const double gap = 0.01, M = 2.0, J = 0.4, A = 0.5, w = 3.0;
  const double restitution = GENERATE(0.0, 0.5);
  JointSeries x = rail_series([=](double t) { return -A * std::cos(w * t); },
                              [=](double t) { return A * w * std::sin(w * t); },
                              [=](double t) { return A * w * w * std::cos(w * t); });
  double s = 0.0;
  while (A * (w * s - std::sin(w * s)) < gap) s += 1e-6;
  const double brakes = 0.5 * std::numbers::pi / w;
  const long leaves = std::lround(brakes / x.dt), hits = static_cast<long>((brakes + s) / x.dt);
  // The motor moves itself alone in between, else the link as well.
  Model model = rail();
  model.gravity = {0.0, 0.0, 0.0};
  model.effects = {{"armature", "slide", {{"armature", J, "kg"}}}};
  x.logged = (J + M) * x.qdd;
  x.logged.middleRows(leaves, hits - leaves) = J * x.qdd.middleRows(leaves, hits - leaves);
  const BoundEffect effect = bind({"backlash",
                                   "slide",
                                   {{"gap", gap, "m"},
                                    {"motor_inertia", J, "kg"},
                                    {"restitution", restitution, "1"},
                                    {"encoder_side", 1.0, "1"}}},
                                  model);
  predict(extend(model), x);
  const VecX<double> torque =
      series_torque(effect, extend(model), x, effect.parameters.data()).col(0);
  CHECK(torque.head(leaves - 2).isZero(0.0));
  CHECK(hits - leaves > 20);
  for (long k = leaves + 2; k < hits - 1; ++k)  // the log lacks what would brake the link
    CHECK_THAT(torque[k], Catch::Matchers::WithinAbs(-M * x.qdd(k, 0), 1e-3));
  // Braked by the teeth in the end, it has lost as much momentum, and has moved by the gap.
  const long rest = static_cast<long>(1.45 * std::numbers::pi / w / x.dt);
  double momentum = 0.0, moved = 0.0;
  for (long k = 0; k < rest; ++k) {
    momentum += torque[k] * x.dt;
    moved += momentum / M * x.dt;
  }
  CHECK_THAT(momentum, Catch::Matchers::WithinAbs(0.0, 1e-9));
  CHECK_THAT(moved, Catch::Matchers::WithinAbs(gap, 2e-3 * gap + 2.0 * x.dt * x.dt * A * w * w));
}

TEST_CASE("series: an elastic joint's friction turns with the motor", "[effects]") {
  Model model = rail();
  model.effects = {{"viscous_friction", "slide", {{"viscous", 7.0, ""}}}};
  JointSeries x = rail_at_rest();
  x.tau = sampled([](double t) { return 50.0 * std::sin(25.0 * t); });
  const BoundEffect e = bind({"joint_elasticity", "slide", {{"stiffness", 4000.0, ""}}}, model);
  const RowMatX<double> expected =  // b (θ̇ − q̇), no rotor
      sampled([](double t) { return 7.0 * 50.0 / 4000.0 * 25.0 * std::cos(25.0 * t); });
  CHECK_THAT(series_torque(e, extend(model), x, e.parameters.data()), MatrixNear(expected, 1e-4));
}

TEST_CASE("series: an elastic joint's friction on the link's side winds its spring up",
          "[effects]") {
  // q = A sin ωt against f(q̇) = F tanh(q̇/v₀) and a spring of stiffness k at the link; by hand:
  // ḟ = F/v₀ (1 − s²) q̈, f̈ = F/v₀ (1 − s²) (d³q/dt³ − 2 s q̈²/v₀), s = tanh(q̇/v₀).
  const double K = 4000.0, J = 0.3, A = 0.2, w = 12.0, F = 30.0, v0 = 0.5, k = 200.0;
  const double share = GENERATE(0.0, 0.4, 1.0);
  CAPTURE(share);
  Model model = rail();
  model.effects = {{"coulomb_friction", "slide", {{"coulomb", F, ""}, {"smoothing", v0, ""}}},
                   {"joint_spring", "slide", {{"stiffness", k, ""}}}};
  const auto v = [=](double t) { return A * w * std::cos(w * t); };
  const auto a = [=](double t) { return -A * w * w * std::sin(w * t); };
  JointSeries x = rail_series([=](double t) { return A * std::sin(w * t); }, v, a);
  x.tau = RowMatX<double>::Zero(kRows, 1);
  const auto slope = [=](double t) {
    const double s = std::tanh(v(t) / v0);
    return F / v0 * (1.0 - s * s) * a(t);
  };
  const auto bend = [=](double t) {
    const double s = std::tanh(v(t) / v0);
    return F / v0 * (1.0 - s * s) * (-w * w * v(t) - 2.0 * s * a(t) * a(t) / v0);
  };
  const RowMatX<double> expected = sampled([=](double t) {
    const double motor = v(t) + ((1.0 - share) * slope(t) + k * v(t)) / K;
    return J / K * ((1.0 - share) * bend(t) + k * a(t)) +
           share * F * (std::tanh(motor / v0) - std::tanh(v(t) / v0));
  });
  const BoundEffect e =
      bind({"joint_elasticity",
            "slide",
            {{"stiffness", K, ""}, {"motor_inertia", J, ""}, {"friction_share", share, ""}}},
           model);
  CHECK(expected.cwiseAbs().maxCoeff() > 0.5);
  // Differences of order four, twice: 2e-5 observed.
  CHECK_THAT(
      series_torque(e, extend(model), x, e.parameters.data()).middleRows(5, kRows - 10).eval(),
      MatrixNear(expected.middleRows(5, kRows - 10).eval(), 1e-3));
}

}  // namespace hidden_motor_test
