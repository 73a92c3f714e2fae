#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

#include "support/jet_jacobian.hpp"
#include "support/matrix_near.hpp"
#include "support/random_arm.hpp"

namespace derivatives_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// Two exact derivatives of torques of order 10², 9 links: rounding leaves 1e-12 (observed), 10² of
/// margin.
constexpr double kRoundingTol = 1e-10;
/// The same after a solve with the mass matrix, whose condition reaches 10⁴ on these arms; the
/// entries reach 10⁴.
constexpr double kSolveTol = 1e-8;

using Jets = VecX<JetD>;

}  // namespace

TEST_CASE("derivatives: of rnea equal the Jets", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 1 + static_cast<int>(seed % 9)});
  RneaDerivatives out;
  rnea_derivatives(arm.tree, arm.q, arm.qd, arm.qdd, out);

  RneaWorkspace<double, double> ws;
  CHECK_THAT(out.tau, MatrixNear(rnea(arm.tree, arm.q, arm.qd, arm.qdd, ws), kRoundingTol));
  RneaWorkspace<double, JetD> jet_ws;
  const auto tau = [&](const Jets& q, const Jets& qd, const Jets& qdd) {
    return rnea(arm.tree, q, qd, qdd, jet_ws);
  };
  const Jets q = arm.q.cast<JetD>(), qd = arm.qd.cast<JetD>(), qdd = arm.qdd.cast<JetD>();
  CHECK_THAT(out.dtau_dq,
             MatrixNear(jet_jacobian(arm.q, [&](const Jets& x) { return tau(x, qd, qdd); }),
                        kRoundingTol));
  CHECK_THAT(out.dtau_dqd,
             MatrixNear(jet_jacobian(arm.qd, [&](const Jets& x) { return tau(q, x, qdd); }),
                        kRoundingTol));
  CHECK_THAT(out.M, MatrixNear(jet_jacobian(arm.qdd, [&](const Jets& x) { return tau(q, qd, x); }),
                               kRoundingTol));
  MassMatrixWorkspace<double, double> mass_ws;
  CHECK_THAT(out.M, MatrixNear(mass_matrix(arm.tree, arm.q, mass_ws), kRoundingTol));
}

TEST_CASE("derivatives: of aba equal the Jets", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 1 + static_cast<int>(seed % 9)});
  AbaDerivatives out;
  aba_derivatives(arm.tree, arm.q, arm.qd, arm.tau, out);

  AbaWorkspace<double, double> ws;
  CHECK_THAT(out.qdd, MatrixNear(aba(arm.tree, arm.q, arm.qd, arm.tau, ws), kSolveTol));
  AbaWorkspace<double, JetD> jet_ws;
  const auto qdd = [&](const Jets& q, const Jets& qd, const Jets& tau) {
    return aba(arm.tree, q, qd, tau, jet_ws);
  };
  const Jets q = arm.q.cast<JetD>(), qd = arm.qd.cast<JetD>(), tau = arm.tau.cast<JetD>();
  CHECK_THAT(
      out.dqdd_dq,
      MatrixNear(jet_jacobian(arm.q, [&](const Jets& x) { return qdd(x, qd, tau); }), kSolveTol));
  CHECK_THAT(
      out.dqdd_dqd,
      MatrixNear(jet_jacobian(arm.qd, [&](const Jets& x) { return qdd(q, x, tau); }), kSolveTol));
  CHECK_THAT(
      out.dqdd_dtau,
      MatrixNear(jet_jacobian(arm.tau, [&](const Jets& x) { return qdd(q, qd, x); }), kSolveTol));
}

TEST_CASE("derivatives: -M^-1 Y is the Jet of aba in every inertial parameter", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 15u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 1 + static_cast<int>(seed % 7)});
  ParameterJacobianWorkspace ws;
  const RowMatX<double> jacobian =
      forward_dynamics_parameter_jacobian(arm.tree, arm.q, arm.qd, arm.tau, ws);

  VecX<double> pi(kThetaSize * arm.tree.num_dofs());
  for (int i = 0; i < pi.size(); ++i)
    pi[i] = arm.tree.links[i / kThetaSize].inertia.theta()[i % kThetaSize];
  Tree<JetD> tree = arm.tree.cast<JetD>();
  AbaWorkspace<JetD, double> jet_ws;
  const auto qdd = [&](const Jets& x) {
    for (int i = 0; i < tree.num_dofs(); ++i) {
      Theta<JetD> theta;
      for (int k = 0; k < kThetaSize; ++k) theta[k] = x[kThetaSize * i + k];
      tree.links[i].inertia = SpatialInertia<JetD>::from_theta(theta);
    }
    return aba(tree, arm.q, arm.qd, arm.tau, jet_ws);
  };
  CHECK_THAT(jacobian, MatrixNear(jet_jacobian(pi, qdd), kSolveTol));
  AbaWorkspace<double, double> aba_ws;
  CHECK_THAT(ws.qdd, MatrixNear(aba(arm.tree, arm.q, arm.qd, arm.tau, aba_ws), kSolveTol));
}

TEST_CASE("derivatives: a vector of the wrong length is refused by name", "[dynamics]") {
  const RandomArm arm(0);
  RneaDerivatives inverse;
  AbaDerivatives forward;
  ParameterJacobianWorkspace parameters;
  const VecX<double> few = arm.q.head(2);
  CHECK_THROWS_AS(rnea_derivatives(arm.tree, arm.q, few, arm.qdd, inverse), ShapeError);
  CHECK_THROWS_AS(aba_derivatives(arm.tree, few, arm.qd, arm.tau, forward), ShapeError);
  CHECK_THROWS_AS(forward_dynamics_parameter_jacobian(arm.tree, arm.q, arm.qd, few, parameters),
                  ShapeError);
}

}  // namespace derivatives_test
