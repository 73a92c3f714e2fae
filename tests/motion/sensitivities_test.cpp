/// Derivatives of simulated windows against central differences, and friction too steep for the
/// time between rows.

#include "motion/sensitivities.hpp"

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/sim/record.hpp>

#include "motion/free_swing.hpp"

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
  MatX<double> J(2 * w.rows, 10);
  const auto moved = [&](int column, double by) {
    Model m = model;
    MotionWindow at = w;
    if (column < 4) at.state[column] += by;
    ModelLink& lower = m.links[static_cast<std::size_t>(moving_links(m)[1])];
    if (column == 4) lower.inertia.m += by;
    if (column == 5) lower.inertia.h.z += by;
    if (column == 6) m.effects[0].parameters[0].value += by;
    if (column == 7) m.effects[0].parameters[1].value *= std::exp(by);
    if (column == 8) m.effects[3].parameters[0].value += by;
    return residuals(m, s, at);
  };
  for (int c = 0; c < 9; ++c) J.col(c) = (moved(c, 1e-5) - moved(c, -1e-5)) / 2e-5;
  J.col(9) = residuals(model, s, w);
  // The factor is of the same rows: Gram matrices are equal.
  MatX<double> R(10, 10);
  R.setZero();
  R.topLeftCorner(9, 9) = rows.R();
  R.topRightCorner(9, 1) = rows.d();
  R(9, 9) = std::sqrt(rows.residual_sum_of_squares());
  const MatX<double> gram = R.transpose() * R, expected = J.transpose() * J;
  /// Central difference, h = 1e-5: h² of the third derivative, 1e-7 of a column (observed).
  constexpr double kTol = 1e-5;
  for (int i = 0; i < 10; ++i)
    for (int k = 0; k < 10; ++k) {
      CAPTURE(i, k);
      CHECK(std::abs(gram(i, k) - expected(i, k)) <
            kTol * std::sqrt(expected(i, i) * expected(k, k)));
    }
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

}  // namespace sensitivities_test
