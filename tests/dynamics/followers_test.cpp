#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/lie/inertia.hpp>

#include "support/jet_jacobian.hpp"
#include "support/matrix_near.hpp"
#include "support/random_followers.hpp"

namespace followers_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// The same sums in another order, of torques of order 10³: rounding leaves 1e-12 (observed).
constexpr double kRoundingTol = 1e-10;
/// The same after a solve with the mass matrix, whose condition reaches 10⁴ on these arms.
constexpr double kSolveTol = 1e-8;

using Jets = VecX<JetD>;

}  // namespace

TEST_CASE("followers: torques, mass matrix and Jacobian are those of the full tree, projected",
          "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const RandomFollowers c(seed);
  RneaWorkspace<double, double> ws, full_ws;
  const VecX<double> of_joints = rnea(c.full, c.q, c.qd, c.qdd, full_ws);
  CHECK_THAT(rnea(c.tree, c.y, c.yd, c.ydd, ws),
             MatrixNear(c.G.transpose() * of_joints, kRoundingTol));
  CHECK_THAT(gravity_torques(c.tree, c.y, ws),
             MatrixNear(c.G.transpose() * gravity_torques(c.full, c.q, full_ws), kRoundingTol));
  MassMatrixWorkspace<double, double> mass_ws, full_mass_ws;
  CHECK_THAT(
      mass_matrix(c.tree, c.y, mass_ws),
      MatrixNear(c.G.transpose() * mass_matrix(c.full, c.q, full_mass_ws) * c.G, kRoundingTol));

  LinkKinematics<double> kinematics, full_kinematics;
  forward_kinematics<double, double>(c.tree, c.y, c.yd, c.ydd, kinematics);
  forward_kinematics<double, double>(c.full, c.q, c.qd, c.qdd, full_kinematics);
  const int last = c.tree.num_links() - 1;
  MatX<double> J, J_full;
  const Pose<double> at = Pose<double>::identity();
  frame_jacobian(c.tree, kinematics, last, at, J);
  frame_jacobian(c.full, full_kinematics, last, at, J_full);
  CHECK_THAT(J, MatrixNear(J_full * c.G, kRoundingTol));
  const Vec3<double> a = kinematics.links[last].A.linear, b = full_kinematics.links[last].A.linear;
  CHECK_THAT((Eigen::Vector3d{a.x, a.y, a.z}),
             MatrixNear(Eigen::Vector3d{b.x, b.y, b.z}, kRoundingTol));
}

TEST_CASE("followers: torques are linear in the inertias of all links", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const RandomFollowers c(seed);
  RegressorWorkspace<double, double> ws;
  const RowMatX<double> Y = torque_regressor(c.tree, c.y, c.yd, c.ydd, ws);
  REQUIRE(Y.cols() == 10 * c.tree.num_links());
  VecX<double> pi(Y.cols());
  for (int i = 0; i < c.tree.num_links(); ++i) {
    const Theta<double> theta = c.tree.links[i].inertia.theta();
    std::copy(theta.begin(), theta.end(), pi.data() + 10 * i);
  }
  VecX<double> tau = Y * pi;
  for (int j = 0; j < c.tree.num_dofs(); ++j) tau[j] += c.tree.armature(j) * c.ydd[j];
  RneaWorkspace<double, double> rnea_ws;
  CHECK_THAT(tau, MatrixNear(rnea(c.tree, c.y, c.yd, c.ydd, rnea_ws), kRoundingTol));
}

TEST_CASE("followers: aba inverts rnea, and leaves the links' wrenches", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const RandomFollowers c(seed);
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> ws;
  const VecX<double> tau = rnea(c.tree, c.y, c.yd, c.ydd, rnea_ws);
  CHECK_THAT(aba(c.tree, c.y, c.yd, tau, ws), MatrixNear(c.ydd, kSolveTol));
  for (int i = 0; i < c.tree.num_links(); ++i) {
    const Vec3<double> d = ws.links[i].F.force - rnea_ws.links[i].F.force;
    CHECK(std::sqrt(dot(d, d)) < kSolveTol);
  }
}

TEST_CASE("followers: derivatives equal the Jets", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomFollowers c(seed);
  RneaDerivatives inverse;
  rnea_derivatives(c.tree, c.y, c.yd, c.ydd, inverse);
  RneaWorkspace<double, JetD> rnea_ws;
  const Jets y = c.y.cast<JetD>(), yd = c.yd.cast<JetD>(), ydd = c.ydd.cast<JetD>(),
             tau = c.tau.cast<JetD>();
  const auto torque = [&](const Jets& p, const Jets& v) {
    return rnea(c.tree, p, v, ydd, rnea_ws);
  };
  CHECK_THAT(
      inverse.dtau_dq,
      MatrixNear(jet_jacobian(c.y, [&](const Jets& x) { return torque(x, yd); }), kRoundingTol));
  CHECK_THAT(
      inverse.dtau_dqd,
      MatrixNear(jet_jacobian(c.yd, [&](const Jets& x) { return torque(y, x); }), kRoundingTol));

  AbaDerivatives forward;
  aba_derivatives(c.tree, c.y, c.yd, c.tau, forward);
  AbaWorkspace<double, JetD> aba_ws;
  const auto acceleration = [&](const Jets& p, const Jets& v, const Jets& u) {
    return aba(c.tree, p, v, u, aba_ws);
  };
  const auto near = [&](const auto& f, const VecX<double>& at) {
    return MatrixNear(jet_jacobian(at, f), kSolveTol);
  };
  CHECK_THAT(forward.dqdd_dq, near([&](const Jets& x) { return acceleration(x, yd, tau); }, c.y));
  CHECK_THAT(forward.dqdd_dqd, near([&](const Jets& x) { return acceleration(y, x, tau); }, c.yd));
  CHECK_THAT(forward.dqdd_dtau, near([&](const Jets& x) { return acceleration(y, yd, x); }, c.tau));

  ParameterJacobianWorkspace parameter_ws;
  const RowMatX<double> by_inertia =
      forward_dynamics_parameter_jacobian(c.tree, c.y, c.yd, c.tau, parameter_ws);
  // A heavier last link, by what a difference of 1e-6 kg shows.
  Tree<double> heavier = c.tree;
  heavier.links.back().inertia.m += 1e-6;
  AbaWorkspace<double, double> ws;
  const VecX<double> before = aba(c.tree, c.y, c.yd, c.tau, ws),
                     slope = (aba(heavier, c.y, c.yd, c.tau, ws) - before) / 1e-6;
  const VecX<double> column = by_inertia.col(by_inertia.cols() - 10);
  CHECK((slope - column).norm() <
        1e-3 * (1.0 + column.norm()));  // one-sided: order 1e-6 × curvature
}

}  // namespace followers_test
