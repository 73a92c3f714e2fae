#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/jet_jacobian.hpp"
#include "support/matrix_near.hpp"
#include "support/random_arm.hpp"
#include "support/tree_parameters.hpp"

namespace aba_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// aba after rnea must give back q̈ of order 5: the condition of M (10³) times rounding, 10² of
/// margin.
constexpr double kRoundTripTol = 1e-10;
/// Wrenches of order 10² from two algorithms: 1e-12 observed, 10² of margin.
constexpr double kWrenchTol = 1e-10;
/// Central difference, h = 1e-6, relative to derivatives that reach 10⁴ rad/s² per kg·m².
constexpr double kStep = 1e-6;
constexpr double kCentralDifferenceTol = 1e-6;

}  // namespace

TEST_CASE("aba: undoes rnea with rotors, gravity, branches and motion", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 60u));
  CAPTURE(seed);
  const RandomArm arm(seed,
                      {.num_dofs = 1 + static_cast<int>(seed % 10), .armature = seed % 3 != 0});
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  const VecX<double> tau = rnea(arm.tree, arm.q, arm.qd, arm.qdd, rnea_ws);
  CHECK_THAT(aba(arm.tree, arm.q, arm.qd, tau, aba_ws), MatrixNear(arm.qdd, kRoundTripTol));
  for (int i = 0; i < arm.tree.num_dofs(); ++i) {
    CAPTURE(i);
    CHECK_THAT(to_eigen(aba_ws.links[i].F.torque),
               MatrixNear(to_eigen(rnea_ws.links[i].F.torque), kWrenchTol));
    CHECK_THAT(to_eigen(aba_ws.links[i].F.force),
               MatrixNear(to_eigen(rnea_ws.links[i].F.force), kWrenchTol));
    CHECK_THAT(to_eigen(aba_ws.links[i].V.linear),
               MatrixNear(to_eigen(rnea_ws.links[i].V.linear), kWrenchTol));
    CHECK_THAT(to_eigen(aba_ws.links[i].A.linear),
               MatrixNear(to_eigen(rnea_ws.links[i].A.linear), kWrenchTol));
  }
}

TEST_CASE("aba: a workspace that has seen another tree gives the same accelerations",
          "[dynamics]") {
  const RandomArm large(1, {.num_dofs = 8}), small(2, {.num_dofs = 3});
  AbaWorkspace<double, double> used, fresh;
  aba(large.tree, large.q, large.qd, large.tau, used);
  CHECK(aba(small.tree, small.q, small.qd, small.tau, used) ==
        aba(small.tree, small.q, small.qd, small.tau, fresh));
}

TEST_CASE("aba: Jets of the state match central differences", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed);
  const int n = arm.tree.num_dofs();
  VecX<double> state(3 * n);
  state << arm.q, arm.qd, arm.tau;
  const auto qdd = [&](const auto& x) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    AbaWorkspace<double, T> ws;
    const VecX<T> q = x.head(n), qd = x.segment(n, n), tau = x.tail(n);
    return VecX<T>(aba(arm.tree, q, qd, tau, ws));
  };
  const MatX<double> jets = jet_jacobian(state, qdd);
  const double scale = 1.0 + jets.cwiseAbs().maxCoeff();
  CHECK_THAT(jets, MatrixNear(central_jacobian(state, kStep, qdd), kCentralDifferenceTol * scale));
}

TEST_CASE("aba: Jets of every parameter, fixed poses included, match central differences",
          "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 5});
  const auto qdd = [&](const auto& x) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    const Tree<T> tree = with_parameters<T>(arm.tree, x);
    AbaWorkspace<T, double> ws;
    return VecX<T>(aba(tree, arm.q, arm.qd, arm.tau, ws));
  };
  const VecX<double> x = VecX<double>::Zero(num_parameters(arm.tree));
  const MatX<double> jets = jet_jacobian(x, qdd);
  const double scale = 1.0 + jets.cwiseAbs().maxCoeff();
  CHECK_THAT(jets, MatrixNear(central_jacobian(x, kStep, qdd), kCentralDifferenceTol * scale));
}

TEST_CASE("aba: a vector of the wrong length is refused by name", "[dynamics]") {
  const RandomArm arm(0);
  AbaWorkspace<double, double> ws;
  CHECK_THROWS_AS(aba(arm.tree, arm.q, arm.qd.head(2), arm.tau, ws), ShapeError);
}

}  // namespace aba_test
