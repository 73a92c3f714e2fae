/// What an effect's torque along a recording changes by with its parameters.

#include <cmath>
#include <numbers>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/effects/series.hpp>

#include "support/bump_table.hpp"
#include "support/joint_waves.hpp"
#include "support/matrix_near.hpp"

namespace series_columns_test {

using namespace diffnea;
using namespace diffnea::test;

TEST_CASE(
    "series_columns: differences of the torque, per unit, or per ln where a shape is positive",
    "[effects]") {
  Model model = wam();
  model.effects = {{"viscous_friction", "joint2", {{"viscous", 2.0, ""}}}};
  const ExtendedTree base = extend(model);
  JointSeries x = waves();
  predict(base, x);
  x.logged = x.total;
  for (const EffectInfo& info : catalogue()) {
    if (acts_on_ball(info)) continue;
    CAPTURE(info.name);
    EffectSpec spec{info.name, "joint2", {}};
    if (info.place == Place::kJointPair) spec.where = "joint2,joint3";
    if (info.place == Place::kTip) spec.where = "tip";
    if (info.place == Place::kBase) spec.where = "base";
    if (info.name == "residual") spec.table = test::bump_table("joint2", "joint3");
    BoundEffect e = bind(spec, model, {0});
    for (std::size_t k = 0; k < e.parameters.size(); ++k) {
      // Small, away from 0, between rows in time; friction smooth over the differences' step.
      if (e.parameters[k] == 0.0) e.parameters[k] = e.parameter_info[k].unit == "s" ? 0.0046 : 0.02;
      if (e.parameter_info[k].name == "smoothing") e.parameters[k] = 0.5;
    }
    if (info.name == "saturation") e.parameters[0] = 0.7 * x.logged.col(1).maxCoeff();
    std::vector<int> which(e.parameters.size());
    for (std::size_t k = 0; k < which.size(); ++k) which[k] = static_cast<int>(k);
    const std::vector<RowMatX<double>> columns =
        series_columns(e, base, x, e.parameters.data(), which);
    REQUIRE(columns.size() == which.size());
    for (const RowMatX<double>& column : columns) CHECK(column.allFinite());
    if (info.name == "saturation" || info.name == "backlash") continue;  // below
    for (std::size_t k = 0; k < which.size(); ++k) {
      CAPTURE(e.parameter_info[k].name);
      const double p = e.parameters[k], h = 1e-3 * std::abs(p);
      const auto torque = [&](double value) {
        std::vector<double> at = e.parameters;
        at[k] = value;
        return series_torque(e, base, x, at.data());
      };
      // Order four, of its own step.
      RowMatX<double> slope =
          (8.0 * (torque(p + h) - torque(p - h)) - torque(p + 2 * h) + torque(p - 2 * h)) /
          (12.0 * h);
      if (scale(e.parameter_info[k]) == Scale::kLog) slope *= p;
      const double size = slope.cwiseAbs().maxCoeff();
      CHECK_THAT(columns[k], MatrixNear(slope, 1e-5 * (size + 1e-6)));
    }
  }
}

TEST_CASE(
    "series_columns: what is linear is the torque of one unit, other amplitudes have a slope at 0",
    "[effects]") {
  const Model model = wam();
  const Tree<double> tree = make_tree(model);
  const JointSeries x = waves();
  const BoundEffect lag = bind({"actuator_lag", "joint1", {}}, model);
  const BoundEffect delay = bind({"actuator_delay", "joint1", {}}, model);
  const RowMatX<double> of_lag = series_columns(lag, tree, x, lag.parameters.data(), {0})[0];
  const RowMatX<double> of_delay = series_columns(delay, tree, x, delay.parameters.data(), {0})[0];
  const double one = 1.0;
  CHECK_THAT(of_lag, MatrixNear(series_torque(lag, tree, x, &one), 0.0));
  // To first order a delay is a lag.
  CHECK_THAT(of_delay.topRows(kRows - 3).eval(),
             MatrixNear(of_lag.topRows(kRows - 3), 1e-4 * of_lag.cwiseAbs().maxCoeff()));
  const BoundEffect offset = bind({"encoder_offset", "joint2", {}}, model);
  CHECK(series_columns(offset, tree, x, offset.parameters.data(), {0})[0].cwiseAbs().maxCoeff() >
        1.0);
}

TEST_CASE("series_columns: a spring behind its motor's encoder moves all links", "[effects]") {
  Model model = wam();
  model.effects = {{"joint_spring", "joint2", {{"stiffness", 30.0, ""}}}};
  const ExtendedTree base = extend(model);
  JointSeries x = waves();
  predict(base, x);
  const BoundEffect e = bind(
      {"joint_elasticity", "joint2", {{"stiffness", 1e7, ""}, {"encoder_side", 1.0, ""}}}, model);
  const double* p = e.parameters.data();
  const RowMatX<double> torque = series_torque(e, base, x, p);
  const std::vector<RowMatX<double>> columns = series_columns(e, base, x, p, {0, 2});
  const long edge = 200, rows = kRows - 2 * edge;  // how it swings at first fades by then
  for (int j = 0; j < 4; ++j) {
    const VecX<double> of_torque = torque.col(j).segment(edge, rows);
    const double size = of_torque.cwiseAbs().maxCoeff();
    CAPTURE(j, size);
    CHECK(size > 1e-6);  // [N·m]
    // In proportion to 1/K, but for the motion's frequency over the spring's, squared: 1e-4.
    CHECK_THAT(columns[0].col(j).segment(edge, rows).eval(),
               MatrixNear((-of_torque).eval(), 1e-3 * size));
  }
  CHECK(columns[1].isZero(0.0));  // the motor moves as the log has it
}

TEST_CASE("series_columns: a limit takes all that is beyond it, and nothing of the rest",
          "[effects]") {
  JointSeries x = rail_at_rest();
  x.logged = sampled([](double t) { return 10.0 * std::sin(12.0 * t); });
  const double limit = 6.0;
  const BoundEffect e = bind({"saturation", "slide", {{"limit", limit, "N"}}}, rail());
  REQUIRE(scale(e.parameter_info[0]) == Scale::kLog);
  const RowMatX<double> column =
      series_columns(e, make_tree(rail()), x, e.parameters.data(), {0})[0];
  long beyond = 0;
  for (long k = 0; k < kRows; ++k) {
    CAPTURE(k);
    const double u = x.logged(k, 0);
    if (std::abs(std::abs(u) - limit) < 1e-2 * limit) continue;  // in a corner: the step spans it
    beyond += std::abs(u) > limit;
    CHECK_THAT(column(k, 0),  // ∂(u − p sign u)/∂ln p; differences, good to six digits
               Catch::Matchers::WithinAbs(std::abs(u) > limit ? -std::copysign(limit, u) : 0.0,
                                          1e-5 * limit));
  }
  CHECK(beyond > kRows / 3);
}

TEST_CASE("series_columns: a wider gap is as much further for the rotor", "[effects]") {
  // Impacts move from row to row: what they sum up to does not. The rotor crosses the gap once and
  // rests at the other flank, so its way is −gap, and ∂(−gap)/∂ln gap the same.
  const double gap = 0.02, J = 0.4, w = 3.0;
  JointSeries x = rail_at_rest();
  x.logged = sampled([&](double t) { return 20.0 * std::sin(w * t); });
  x.tau = x.logged;  // something holds the link against the teeth
  const BoundEffect e =
      bind({"backlash",
            "slide",
            {{"gap", gap, "m"}, {"motor_inertia", J, "kg"}, {"restitution", 0.0, "1"}}},
           rail());
  REQUIRE(scale(e.parameter_info[0]) == Scale::kLog);
  const RowMatX<double> column =
      series_columns(e, make_tree(rail()), x, e.parameters.data(), {0})[0];
  REQUIRE(column.allFinite());
  double momentum = 0.0, way = 0.0;
  for (long k = 0; k < static_cast<long>(1.9 * std::numbers::pi / w / kDt); ++k) {
    momentum += column(k, 0) * kDt;
    way += momentum / J * kDt;
  }
  CHECK_THAT(momentum, Catch::Matchers::WithinAbs(0.0, 1e-9));
  CHECK_THAT(way, Catch::Matchers::WithinAbs(-gap, 0.1 * gap));
}

}  // namespace series_columns_test
