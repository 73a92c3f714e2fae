#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/matrix_near.hpp"
#include "support/random_arm.hpp"

namespace regressor_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// Two exact algorithms on torques of order 10² N·m: rounding leaves 1e-13 (observed), 10² of
/// margin.
constexpr double kRoundingTol = 1e-11;

VecX<double> parameters(const Tree<double>& tree) {
  VecX<double> pi(kThetaSize * tree.num_dofs());
  for (int i = 0; i < tree.num_dofs(); ++i) {
    const Theta<double> theta = tree.links[i].inertia.theta();
    for (int k = 0; k < kThetaSize; ++k) pi[kThetaSize * i + k] = theta[k];
  }
  return pi;
}

}  // namespace

TEST_CASE("regressor: Y pi and the rotors' torque are the inverse dynamics", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 1 + static_cast<int>(seed % 9)});
  RegressorWorkspace<double, double> ws;
  RneaWorkspace<double, double> rnea_ws;
  VecX<double> tau = torque_regressor(arm.tree, arm.q, arm.qd, arm.qdd, ws) * parameters(arm.tree);
  for (int i = 0; i < arm.tree.num_dofs(); ++i) tau[i] += arm.tree.links[i].armature * arm.qdd[i];
  CHECK_THAT(tau, MatrixNear(rnea(arm.tree, arm.q, arm.qd, arm.qdd, rnea_ws), kRoundingTol));
}

TEST_CASE("regressor: each column is the torque of one unit parameter", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 5u));
  CAPTURE(seed);
  RandomArm arm(seed);
  RegressorWorkspace<double, double> ws;
  RneaWorkspace<double, double> rnea_ws;
  const RowMatX<double> Y = torque_regressor(arm.tree, arm.q, arm.qd, arm.qdd, ws);
  for (Link<double>& link : arm.tree.links) link.inertia = {}, link.armature = 0.0;
  for (int column = 0; column < Y.cols(); ++column) {
    CAPTURE(column);
    Theta<double> unit{};
    unit[column % kThetaSize] = 1.0;
    SpatialInertia<double>& inertia = arm.tree.links[column / kThetaSize].inertia;
    inertia = SpatialInertia<double>::from_theta(unit);
    CHECK_THAT(Y.col(column),
               MatrixNear(rnea(arm.tree, arm.q, arm.qd, arm.qdd, rnea_ws), kRoundingTol));
    inertia = {};
  }
}

TEST_CASE("regressor: a workspace that has seen another tree gives the same rows", "[dynamics]") {
  const RandomArm large(1, {.num_dofs = 8}), small(2, {.num_dofs = 3});
  RegressorWorkspace<double, double> used, fresh;
  torque_regressor(large.tree, large.q, large.qd, large.qdd, used);
  CHECK(torque_regressor(small.tree, small.q, small.qd, small.qdd, used) ==
        torque_regressor(small.tree, small.q, small.qd, small.qdd, fresh));
}

TEST_CASE("regressor: a vector of the wrong length is refused by name", "[dynamics]") {
  const RandomArm arm(0);
  RegressorWorkspace<double, double> ws;
  CHECK_THROWS_AS(torque_regressor(arm.tree, arm.q, arm.qd.head(2), arm.qdd, ws), ShapeError);
}

}  // namespace regressor_test
