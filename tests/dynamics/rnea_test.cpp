#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/jet_jacobian.hpp"
#include "support/matrix_near.hpp"
#include "support/random_arm.hpp"
#include "support/tree_parameters.hpp"

namespace rnea_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::WithinAbs;

namespace {

/// Closed forms and identities of torques of order 10²: rounding leaves 1e-13 (observed), 10² of
/// margin.
constexpr double kRoundingTol = 1e-11;
/// Central difference, h = 1e-6, on torques of order 10²: rounding leaves 1e-8 (observed), 10² of
/// margin.
constexpr double kStep = 1e-6;
constexpr double kCentralDifferenceTol = 1e-5;
/// Lagrange's equation by nested differences, h = 1e-4, of energies of order 10² J: rounding leaves
/// 1e-14·10²/h² = 1e-4, truncation about as much.
constexpr double kLagrangeStep = 1e-4;
constexpr double kLagrangeTol = 5e-3;

/// Kinetic energy of links and rotors, point by point from poses and twists; no inertia is
/// transformed.
double kinetic_energy(const Tree<double>& tree, const VecX<double>& q, const VecX<double>& qd) {
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, q, qd, VecX<double>::Zero(q.size()), kinematics);
  double energy = 0.0;
  for (int i = 0; i < tree.num_dofs(); ++i) {
    const SpatialInertia<double>& b = tree.links[i].inertia;
    const Twist<double>& V = kinematics.links[i].V;
    energy += 0.5 * b.m * dot(V.linear, V.linear) + dot(V.linear, cross(V.angular, b.h)) +
              0.5 * dot(V.angular, b.I * V.angular) + 0.5 * tree.links[i].armature * qd[i] * qd[i];
  }
  return energy;
}

double potential_energy(const Tree<double>& tree, const VecX<double>& q) {
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, q, kinematics);
  double energy = 0.0;
  for (int i = 0; i < tree.num_dofs(); ++i) {
    const Pose<double>& X = kinematics.links[i].X_WL;
    const SpatialInertia<double>& b = tree.links[i].inertia;
    energy -= dot(tree.gravity, X.p * b.m + X.R * b.h);
  }
  return energy;
}

/// A link of a planar chain about y: mass m at distance c along x, inertia J about its centre of
/// mass.
Link<double> planar_link(int parent, double offset, double m, double c, double J) {
  Link<double> link;
  link.parent = parent;
  link.axis = {0, 1, 0};
  link.X_PJ.p = {offset, 0, 0};
  link.inertia = inertia_from_com<double>(m, {c, 0, 0}, {J, 0, 0, J, 0, J});
  return link;
}

}  // namespace

TEST_CASE("rnea: a pendulum has its closed form", "[dynamics]") {
  Tree<double> tree;
  tree.links = {planar_link(-1, 0.3, 2.0, 0.5, 0.04)};
  tree.links[0].armature = 0.1;
  const VecX<double> q = VecX<double>::Constant(1, 0.7), qd = VecX<double>::Constant(1, -1.3),
                     qdd = VecX<double>::Constant(1, 2.5);
  RneaWorkspace<double, double> ws;
  // About +y a positive angle lowers +x: the torque that holds the mass is −m g c cos q.
  const double expected = (2.0 * 0.25 + 0.04 + 0.1) * 2.5 - 2.0 * 9.81 * 0.5 * std::cos(0.7);
  CHECK_THAT(rnea(tree, q, qd, qdd, ws)[0], WithinAbs(expected, kRoundingTol));
}

TEST_CASE("rnea: a two-link arm has its closed form", "[dynamics]") {
  const double m1 = 1.5, m2 = 0.8, c1 = 0.2, c2 = 0.3, l1 = 0.5, J1 = 0.03, J2 = 0.02, g = 9.81;
  Tree<double> tree;
  tree.links = {planar_link(-1, 0.0, m1, c1, J1), planar_link(0, l1, m2, c2, J2)};
  VecX<double> q(2), qd(2), qdd(2), expected(2);
  q << 0.4, -1.1;
  qd << 1.7, -2.3;
  qdd << -3.1, 4.2;
  // Spong, Hutchinson, Vidyasagar 2006, planar elbow arm; angles about +y (gravity's sign turns
  // over).
  const double c = std::cos(q[1]), h = -m2 * l1 * c2 * std::sin(q[1]);
  const double d11 = m1 * c1 * c1 + m2 * (l1 * l1 + c2 * c2 + 2 * l1 * c2 * c) + J1 + J2;
  const double d12 = m2 * (c2 * c2 + l1 * c2 * c) + J2, d22 = m2 * c2 * c2 + J2;
  const double g2 = -m2 * g * c2 * std::cos(q[0] + q[1]);
  const double g1 = -(m1 * c1 + m2 * l1) * g * std::cos(q[0]) + g2;
  expected << d11 * qdd[0] + d12 * qdd[1] + h * qd[1] * (2 * qd[0] + qd[1]) + g1,
      d12 * qdd[0] + d22 * qdd[1] - h * qd[0] * qd[0] + g2;
  RneaWorkspace<double, double> ws;
  CHECK_THAT(rnea(tree, q, qd, qdd, ws), MatrixNear(expected, kRoundingTol));
}

TEST_CASE("rnea: torques solve Lagrange's equation of the energies", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 4});
  const int n = arm.tree.num_dofs();
  const double h = kLagrangeStep;
  const auto energy = [&](const VecX<double>& q, const VecX<double>& qd) {
    return kinetic_energy(arm.tree, q, qd);
  };
  VecX<double> tau(n);
  for (int i = 0; i < n; ++i) {
    const VecX<double> e = VecX<double>::Unit(n, i);
    // ∂T/∂q̇_i is exact by a unit step: T is quadratic in q̇.
    const auto momentum = [&](double t) {
      const VecX<double> q = arm.q + arm.qd * t + arm.qdd * (0.5 * t * t),
                         qd = arm.qd + arm.qdd * t;
      return 0.5 * (energy(q, qd + e) - energy(q, qd - e));
    };
    tau[i] =
        (momentum(h) - momentum(-h)) / (2 * h) -
        (energy(arm.q + h * e, arm.qd) - energy(arm.q - h * e, arm.qd)) / (2 * h) +
        (potential_energy(arm.tree, arm.q + h * e) - potential_energy(arm.tree, arm.q - h * e)) /
            (2 * h);
  }
  RneaWorkspace<double, double> ws;
  CHECK_THAT(rnea(arm.tree, arm.q, arm.qd, arm.qdd, ws), MatrixNear(tau, kLagrangeTol));
}

TEST_CASE("rnea: linear in acceleration with the mass matrix", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 1 + static_cast<int>(seed % 9)});
  RneaWorkspace<double, double> ws;
  MassMatrixWorkspace<double, double> mass_ws;
  const VecX<double> tau = rnea(arm.tree, arm.q, arm.qd, arm.qdd, ws);
  const VecX<double> bias = rnea(arm.tree, arm.q, arm.qd, VecX<double>::Zero(arm.q.size()), ws);
  const MatX<double> M = mass_matrix(arm.tree, arm.q, mass_ws);
  CHECK_THAT(M * arm.qdd, MatrixNear(tau - bias, kRoundingTol));
  CHECK(M == M.transpose());
  CHECK_THAT(0.5 * arm.qd.dot(M * arm.qd),
             WithinAbs(kinetic_energy(arm.tree, arm.q, arm.qd), kRoundingTol));
}

TEST_CASE("rnea: the wrench at every joint balances momentum and the wrenches beyond it",
          "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed);
  RneaWorkspace<double, double> ws;
  rnea(arm.tree, arm.q, arm.qd, arm.qdd, ws);
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(arm.tree, arm.q, arm.qd, arm.qdd, kinematics);
  for (int i = 0; i < arm.tree.num_dofs(); ++i) {
    CAPTURE(i);
    // Newton's and Euler's laws for link i about its centre of mass, in W.
    const SpatialInertia<double>& b = arm.tree.links[i].inertia;
    const Pose<double> com{Mat3<double>::identity(), b.h * (1.0 / b.m)};
    const FrameMotion<double> motion = frame_motion(kinematics, i, com);
    const Sym3<double> I_W = rotate(motion.X_WF.R, inertia_about_com(b));
    const Vec3<double>& w = motion.angular_velocity;
    const Vec3<double> force = (motion.acceleration - arm.tree.gravity) * b.m;
    const Vec3<double> torque = I_W * motion.angular_acceleration + cross(w, I_W * w);
    Vec3<double> total_force{}, total_torque{};
    const auto add = [&](int link, double sign) {
      const Pose<double>& X_WL = kinematics.links[link].X_WL;
      const Vec3<double> f = X_WL.R * ws.links[link].F.force * sign;
      total_force += f;
      total_torque += X_WL.R * ws.links[link].F.torque * sign + cross(X_WL.p - motion.X_WF.p, f);
    };
    add(i, 1.0);
    for (int child = i + 1; child < arm.tree.num_dofs(); ++child)
      if (arm.tree.links[child].parent == i) add(child, -1.0);
    CHECK_THAT(to_eigen(total_force), MatrixNear(to_eigen(force), 10 * kRoundingTol));
    CHECK_THAT(to_eigen(total_torque), MatrixNear(to_eigen(torque), 10 * kRoundingTol));
  }
}

TEST_CASE("rnea: gravity torques are the torques of rest", "[dynamics]") {
  const RandomArm arm(3);
  RneaWorkspace<double, double> ws;
  const auto energy = [&](const VecX<double>& q) {
    return VecX<double>::Constant(1, potential_energy(arm.tree, q));
  };
  CHECK_THAT(gravity_torques(arm.tree, arm.q, ws).transpose(),
             MatrixNear(central_jacobian(arm.q, kStep, energy), kCentralDifferenceTol));
}

TEST_CASE("rnea: Jets of the state match central differences", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed);
  const int n = arm.tree.num_dofs();
  VecX<double> state(3 * n);
  state << arm.q, arm.qd, arm.qdd;
  const auto tau = [&](const auto& x) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    RneaWorkspace<double, T> ws;
    const VecX<T> q = x.head(n), qd = x.segment(n, n), qdd = x.tail(n);
    return VecX<T>(rnea(arm.tree, q, qd, qdd, ws));
  };
  CHECK_THAT(jet_jacobian(state, tau),
             MatrixNear(central_jacobian(state, kStep, tau), kCentralDifferenceTol));
}

TEST_CASE("rnea: Jets of every parameter, fixed poses included, match central differences",
          "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 5});
  const auto tau = [&](const auto& x) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    const Tree<T> tree = with_parameters<T>(arm.tree, x);
    RneaWorkspace<T, double> ws;
    return VecX<T>(rnea(tree, arm.q, arm.qd, arm.qdd, ws));
  };
  const VecX<double> x = VecX<double>::Zero(num_parameters(arm.tree));
  CHECK_THAT(jet_jacobian(x, tau),
             MatrixNear(central_jacobian(x, kStep, tau), kCentralDifferenceTol));
}

TEST_CASE("rnea: a vector of the wrong length is refused by name", "[dynamics]") {
  const RandomArm arm(0);
  RneaWorkspace<double, double> ws;
  CHECK_THROWS_AS(rnea(arm.tree, arm.q, arm.qd, arm.qdd.head(2), ws), ShapeError);
}

}  // namespace rnea_test
