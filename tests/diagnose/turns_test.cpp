/// How friction turns, against its formula's own derivatives.

#include "diagnose/turns.hpp"

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/rod.hpp"

namespace turns_test {

using namespace diffnea;

namespace {

constexpr double kV0 = 0.02, kCoulomb = 1.7, kViscous = 0.4;

Model with_friction() {
  Model model = read_model(DIFFNEA_SOURCE_DIR "/models/emps.urdf");
  const std::string joint = joint_names(model).front();
  model.effects = {
      {"viscous_friction", joint, {{"viscous", kViscous, ""}}},
      {"coulomb_friction", joint, {{"coulomb", kCoulomb, ""}, {"smoothing", kV0, ""}}}};
  return model;
}

}  // namespace

TEST_CASE("diagnose: friction that turns before the velocity does is no spring", "[diagnose]") {
  const double T = GENERATE(0.0, 9.5e-3);
  CAPTURE(T);
  // MuJoCo's `frictionloss`, a soft constraint: T is half of 0.95 times its `solreffriction`.
  const auto soft = [&](double, double qd, double qdd) {
    constexpr double kWidth = 0.03;  // [rad/s]
    return test::kRodFriction * std::clamp((qd + T * qdd) / kWidth, -1.0, 1.0);
  };
  const Finding f =
      diagnose(test::rod(), {test::rod_recording(1, soft)}, {test::rod_recording(2, soft)});
  CHECK(f.verdict == Verdict::kNone);
  CHECK(f.causes.empty());
}

TEST_CASE("diagnose: the columns of friction's turn are its derivatives", "[diagnose]") {
  const Model model = with_friction();
  FitChoice choice;
  choice.effects = std::vector<std::string>{};
  const FitLayout layout = make_layout(model, choice, {0});
  const auto shape = std::ranges::find_if(layout.shape, is_smoothing);
  REQUIRE(shape != layout.shape.end());
  const BoundEffect friction = friction_of(layout, *shape);
  REQUIRE(friction.info().name == "coulomb_friction");

  JointSeries x;
  x.dt = 5e-4;
  const long rows = 4000;
  x.q = x.qd = x.qdd = RowMatX<double>::Zero(rows, 1);
  const double w = 4.0, a = 0.3;
  for (long k = 0; k < rows; ++k) {
    const double t = x.dt * static_cast<double>(k);
    x.q(k, 0) = a * std::sin(w * t);
    x.qd(k, 0) = a * w * std::cos(w * t);
    x.qdd(k, 0) = -a * w * w * std::sin(w * t);
  }
  const auto columns = turn_columns(friction, shape->index, extend(model, {}, 0), x);
  double worst_timing = 0.0, worst_bend = 0.0;
  for (long k = 8; k + 8 < rows; ++k) {
    const double v = x.qd(k, 0) / kV0, s = 1.0 / std::cosh(v), slope = kCoulomb * s * s;
    worst_timing =
        std::max(worst_timing, std::abs(columns[0](k, 0) - 1e-3 * slope * x.qdd(k, 0) / kV0));
    // ½ ∂²/∂(ln v₀)² of tanh v, v = q̇/v₀
    const double bend = 0.5 * slope * v * (1.0 - 2.0 * v * std::tanh(v));
    worst_bend = std::max(worst_bend, std::abs(columns[1](k, 0) - bend));
  }
  // Differences over 2 ms and a factor of 1.5 in v₀, of curves that turn within 17 ms: a tenth of
  // the largest derivative, 0.41 and 0.3 N·m.
  CHECK(worst_timing < 0.04);
  CHECK(worst_bend < 0.03 * kCoulomb);
  CHECK(columns[0].cwiseAbs().maxCoeff() > 0.3);
}

}  // namespace turns_test
