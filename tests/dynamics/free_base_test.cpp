#include <Eigen/Geometry>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/model/free_base.hpp>

#include "support/jet_jacobian.hpp"
#include "support/matrix_near.hpp"
#include "support/random_floating.hpp"

namespace free_base_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// The same sums in another order, of torques of order 10³: rounding leaves 1e-12 (observed).
constexpr double kRoundingTol = 1e-10;
/// The same after a solve with the mass matrix, whose condition reaches 10⁴.
constexpr double kSolveTol = 1e-8;
/// Central difference, h = 1e-6, relative to the largest derivative.
constexpr double kStep = 1e-6;
constexpr double kCentralDifferenceTol = 1e-6;

Eigen::Vector3d eigen(const Vec3<double>& v) { return to_eigen(v); }

VecX<double> stacked(const Vec3<double>& angular, const Vec3<double>& linear) {
  VecX<double> out(6);
  out << to_eigen(angular), to_eigen(linear);
  return out;
}

/// State of the robot on six joints, and what the base's motion is there.
struct SixJointState {
  explicit SixJointState(unsigned seed, const Tree<double>& floating) : carried(floating) {
    Rng rng(seed + 1000);
    const Tree<double>& tree = carried.tree;
    q = random_vector(rng, tree.num_dofs(), 0.7);
    qd = random_vector(rng, tree.num_dofs(), 2.0);
    qdd = random_vector(rng, tree.num_dofs(), 5.0);
    LinkKinematics<double> kinematics;
    forward_kinematics<double, double>(tree, q, qd, qdd, kinematics);
    const auto& base = kinematics.links[OnSixJoints::kBase];
    const int joints = floating.num_dofs();
    const Eigen::Quaterniond turn(to_eigen(base.X_WL.R));
    free_q.resize(kBasePositions + joints);
    free_q << to_eigen(base.X_WL.p), turn.coeffs(), q.tail(joints);
    free_v.resize(kBaseVelocities + joints);
    free_v << stacked(base.V.angular, base.V.linear), qd.tail(joints);
    free_vd.resize(kBaseVelocities + joints);
    free_vd << stacked(base.A.angular, base.A.linear), qdd.tail(joints);
    // Twist of B per velocity of the six joints, by columns.
    G = MatX<double>::Identity(kBaseVelocities + joints, kBaseVelocities + joints);
    for (int k = 0; k < 6; ++k) {
      forward_kinematics<double, double>(tree, q, VecX<double>::Unit(tree.num_dofs(), k), 0.0 * qdd,
                                         kinematics);
      const Twist<double>& V = kinematics.links[OnSixJoints::kBase].V;
      G.col(k).head<6>() = stacked(V.angular, V.linear);
    }
  }
  OnSixJoints carried;
  VecX<double> q, qd, qdd, free_q, free_v, free_vd;
  MatX<double> G;  ///< v = G q̇
};

/// Momentum of all links in W, about its origin, with mass and first moment of mass.
struct Momentum {
  Vec3<double> angular{}, linear{}, first_moment{};
  double mass = 0.0, energy = 0.0;  ///< energy with that of height
};
Momentum momentum(const Tree<double>& tree, const VecX<double>& q, const VecX<double>& v) {
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, q, v, 0.0 * v, kinematics);
  Momentum out;
  for (int i = 0; i < tree.num_links(); ++i) {
    const auto& l = kinematics.links[i];
    const SpatialInertia<double>& M = tree.links[i].inertia;
    const Wrench<double> own = M * l.V, h = to_parent(l.X_WL, own);
    out.angular += h.torque;
    out.linear += h.force;
    out.mass += M.m;
    const Vec3<double> moment = l.X_WL.R * M.h + l.X_WL.p * M.m;
    out.first_moment += moment;
    out.energy += 0.5 * dot(l.V, own) - dot(tree.gravity, moment);
  }
  return out;
}
/// Angular momentum about the centre of mass.
Vec3<double> spin(const Momentum& h) {
  return h.angular - cross(h.first_moment * (1.0 / h.mass), h.linear);
}

/// Rate of q at the velocity v: ṗ = R v, q̇uat = ½ quat ∘ [ω; 0].
VecX<double> rate(const VecX<double>& q, const VecX<double>& v) {
  VecX<double> out(q.size());
  const Pose<double> X = base_pose(q.data());
  const Vec3<double> w{v[0], v[1], v[2]}, p{q[3], q[4], q[5]};
  out.head<3>() = to_eigen(X.R * Vec3<double>{v[3], v[4], v[5]});
  out.segment<3>(3) = to_eigen((w * q[6] + cross(p, w)) * 0.5);
  out[6] = -0.5 * dot(p, w);
  out.tail(q.size() - kBasePositions) = v.tail(v.size() - kBaseVelocities);
  return out;
}

}  // namespace

TEST_CASE("free base: dynamics are those of a base that six joints carry", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const RandomFloating robot(seed, {.num_dofs = static_cast<int>(seed % 9)});
  const SixJointState s(seed, robot.tree);
  RneaWorkspace<double, double> ws, carried_ws;
  const VecX<double> tau = rnea(robot.tree, s.free_q, s.free_v, s.free_vd, ws);
  CHECK_THAT(s.G.transpose() * tau,
             MatrixNear(rnea(s.carried.tree, s.q, s.qd, s.qdd, carried_ws), kRoundingTol));
  CHECK_THAT(s.G.transpose() * gravity_torques(robot.tree, s.free_q, ws),
             MatrixNear(gravity_torques(s.carried.tree, s.q, carried_ws), kRoundingTol));
  MassMatrixWorkspace<double, double> mass_ws, carried_mass_ws;
  CHECK_THAT(s.G.transpose() * mass_matrix(robot.tree, s.free_q, mass_ws) * s.G,
             MatrixNear(mass_matrix(s.carried.tree, s.q, carried_mass_ws), kRoundingTol));

  LinkKinematics<double> kinematics, carried;
  forward_kinematics<double, double>(robot.tree, s.free_q, s.free_v, s.free_vd, kinematics);
  forward_kinematics<double, double>(s.carried.tree, s.q, s.qd, s.qdd, carried);
  LinkKinematics<double> from_rnea;  // whose accelerations hold gravity
  rnea(robot.tree, s.free_q, s.free_v, s.free_vd, ws);
  forward_kinematics<double, double>(robot.tree, ws, from_rnea);
  for (int i = 0; i < robot.tree.num_links(); ++i) {
    const auto &a = from_rnea.links[i], &b = kinematics.links[i];
    CHECK_THAT(eigen(a.X_WL.p), MatrixNear(eigen(b.X_WL.p), kRoundingTol));
    CHECK_THAT(stacked(a.V.angular, a.V.linear),
               MatrixNear(stacked(b.V.angular, b.V.linear), kRoundingTol));
    CHECK_THAT(stacked(a.A.angular, a.A.linear),
               MatrixNear(stacked(b.A.angular, b.A.linear), kRoundingTol));
  }
  const int tip = robot.tree.num_links() - 1, carried_tip = tip + OnSixJoints::kBase;
  const Pose<double> X_LF{Mat3<double>::identity(), {0.1, -0.2, 0.3}};
  const FrameMotion<double> here = frame_motion(kinematics, tip, X_LF),
                            there = frame_motion(carried, carried_tip, X_LF);
  CHECK_THAT(eigen(here.X_WF.p), MatrixNear(eigen(there.X_WF.p), kRoundingTol));
  CHECK_THAT(eigen(here.velocity), MatrixNear(eigen(there.velocity), kRoundingTol));
  CHECK_THAT(eigen(here.acceleration), MatrixNear(eigen(there.acceleration), kRoundingTol));
  MatX<double> J, J_carried;
  frame_jacobian(robot.tree, kinematics, tip, X_LF, J);
  frame_jacobian(s.carried.tree, carried, carried_tip, X_LF, J_carried);
  CHECK_THAT(J * s.G, MatrixNear(J_carried, kRoundingTol));
  CHECK_THAT(J * s.free_v, MatrixNear(stacked(here.angular_velocity, here.velocity), kRoundingTol));
}

TEST_CASE("free base: aba undoes rnea, and leaves the links' wrenches", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const RandomFloating s(seed, {.num_dofs = static_cast<int>(seed % 9)});
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> ws;
  const VecX<double> tau = rnea(s.tree, s.q, s.v, s.vd, rnea_ws);
  CHECK_THAT(aba(s.tree, s.q, s.v, tau, ws), MatrixNear(s.vd, kSolveTol));
  for (int i = 0; i < s.tree.num_links(); ++i) {
    CAPTURE(i);
    const auto &a = ws.links[i], &b = rnea_ws.links[i];
    CHECK_THAT(stacked(a.F.torque, a.F.force),
               MatrixNear(stacked(b.F.torque, b.F.force), kSolveTol));
    CHECK_THAT(stacked(a.A.angular, a.A.linear),
               MatrixNear(stacked(b.A.angular, b.A.linear), kSolveTol));
  }
  MassMatrixWorkspace<double, double> mass_ws;
  const VecX<double> bias = rnea(s.tree, s.q, s.v, 0.0 * s.vd, rnea_ws);
  CHECK_THAT(mass_matrix(s.tree, s.q, mass_ws) * s.vd + bias, MatrixNear(tau, kRoundingTol));
}

TEST_CASE("free base: wrench and torques are linear in the inertias of all links", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const RandomFloating s(seed, {.num_dofs = static_cast<int>(seed % 9)});
  RegressorWorkspace<double, double> ws;
  ws.Y.setConstant(kBaseVelocities + s.tree.num_dofs(), 10 * s.tree.num_links(), 1e3);  // no relic
  const RowMatX<double> Y = torque_regressor(s.tree, s.q, s.v, s.vd, ws);
  VecX<double> pi(Y.cols());
  for (int i = 0; i < s.tree.num_links(); ++i) {
    const Theta<double> theta = s.tree.links[i].inertia.theta();
    std::copy(theta.begin(), theta.end(), pi.data() + kThetaSize * i);
  }
  VecX<double> tau = Y * pi;
  for (int j = 0; j < s.tree.num_dofs(); ++j)
    tau[kBaseVelocities + j] += s.tree.armature(j) * s.vd[kBaseVelocities + j];
  RneaWorkspace<double, double> rnea_ws;
  CHECK_THAT(tau, MatrixNear(rnea(s.tree, s.q, s.v, s.vd, rnea_ws), kRoundingTol));
}

TEST_CASE("free base: a flight keeps momentum about the centre of mass, and energy", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 8u));
  CAPTURE(seed);
  RandomFloating s(seed,
                   {.num_dofs = 1 + static_cast<int>(seed),
                    .prismatic = false,
                    .armature = false});  // rotors turn without a body, and spin is not theirs
  s.v.tail(s.tree.num_dofs()) *= 0.5;
  AbaWorkspace<double, double> ws;
  const bool driven = seed % 2 == 1;  // by forces within: energy is not kept then
  const auto force = [&](double t) {
    VecX<double> tau = VecX<double>::Zero(s.tree.num_velocities());
    if (driven)
      tau.tail(s.tree.num_dofs()) = s.tau.tail(s.tree.num_dofs()) * (0.1 * std::sin(9 * t));
    return tau;
  };
  const Momentum before = momentum(s.tree, s.q, s.v);
  const int steps = 2000;
  const double duration = 0.4, h = duration / steps;
  VecX<double> q = s.q, v = s.v;
  for (int k = 0; k < steps; ++k) {  // Runge–Kutta of order four
    const double t = k * h;
    const VecX<double> q1 = rate(q, v), v1 = aba(s.tree, q, v, force(t), ws);
    VecX<double> at = v + 0.5 * h * v1;
    const auto unit = [](VecX<double> x) {
      x.segment<4>(3).normalize();
      return x;
    };
    const VecX<double> q2 = rate(q + 0.5 * h * q1, at),
                       v2 = aba(s.tree, unit(q + 0.5 * h * q1), at, force(t + 0.5 * h), ws);
    at = v + 0.5 * h * v2;
    const VecX<double> q3 = rate(q + 0.5 * h * q2, at),
                       v3 = aba(s.tree, unit(q + 0.5 * h * q2), at, force(t + 0.5 * h), ws);
    at = v + h * v3;
    const VecX<double> q4 = rate(q + h * q3, at),
                       v4 = aba(s.tree, unit(q + h * q3), at, force(t + h), ws);
    q = unit(q + (h / 6) * (q1 + 2 * q2 + 2 * q3 + q4));
    v += (h / 6) * (v1 + 2 * v2 + 2 * v3 + v4);
  }
  const Momentum after = momentum(s.tree, q, v);
  // Steps of 0.2 ms at 10 rad/s: h⁴ times a fifth derivative leaves 1e-8 and less (observed).
  constexpr double kFlightTol = 1e-6;
  CHECK((v - s.v).norm() > 1.0);
  CHECK_THAT(eigen(spin(after)), MatrixNear(eigen(spin(before)), kFlightTol));
  CHECK_THAT(
      eigen(after.linear),
      MatrixNear(eigen(before.linear + s.tree.gravity * (before.mass * duration)), kFlightTol));
  if (driven)
    CHECK(std::abs(after.energy - before.energy) > 1e-3);
  else
    CHECK(std::abs(after.energy - before.energy) < kFlightTol);
}

TEST_CASE("free base: Jets on the manifold match central differences", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomFloating s(seed, {.num_dofs = 1 + static_cast<int>(seed % 6)});
  const int n = s.tree.num_velocities();
  VecX<double> state(3 * n);
  state << VecX<double>::Zero(n), s.v, s.tau;
  const auto both = [&](const auto& x) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    const VecX<T> q = integrate<double, T>(s.tree, s.q.cast<T>(), x.head(n)), v = x.segment(n, n),
                  u = x.tail(n);
    AbaWorkspace<double, T> aba_ws;
    RneaWorkspace<double, T> rnea_ws;
    VecX<T> out(2 * n);
    out << VecX<T>(aba(s.tree, q, v, u, aba_ws)), VecX<T>(rnea(s.tree, q, v, u, rnea_ws));
    return out;
  };
  const MatX<double> jets = jet_jacobian(state, both);
  const double scale = 1.0 + jets.cwiseAbs().maxCoeff();
  CHECK_THAT(jets, MatrixNear(central_jacobian(state, kStep, both), kCentralDifferenceTol * scale));
  CHECK(jets.leftCols(3).cwiseAbs().maxCoeff() > 1e-3);  // gravity turns against the base
  CHECK(jets.middleCols(3, 3).cwiseAbs().maxCoeff() < kRoundingTol * scale);  // and is everywhere
}

TEST_CASE("free base: analytic derivatives on the manifold equal the Jets", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  const bool follows = GENERATE(false, true);
  CAPTURE(seed, follows);
  RandomFloating s(seed, {.num_dofs = 1 + static_cast<int>(seed % 6)});
  const int joints = s.tree.num_joints();
  for (int j = 0; follows && j < joints; ++j)  // the last one moves with the first
    s.tree.coordinates.joints.push_back(j + 1 < joints || j == 0
                                            ? JointDrive{s.tree.coordinates.count++, 1.0, 0.0}
                                            : JointDrive{0, -0.7, 0.3});
  const int n = s.tree.num_velocities();
  const VecX<double> q = s.q.head(s.tree.num_positions()), v = s.v.head(n), u = s.vd.head(n);
  VecX<double> state(3 * n);
  state << VecX<double>::Zero(n), v, u;
  const auto slopes = [&](const auto& dynamics) {
    return jet_jacobian(state, [&](const VecX<JetD>& x) {
      return dynamics(integrate<double, JetD>(s.tree, q.cast<JetD>(), x.head(n)),
                      VecX<JetD>(x.segment(n, n)), VecX<JetD>(x.tail(n)));
    });
  };
  RneaWorkspace<double, JetD> rnea_ws;
  const MatX<double> of_tau =
      slopes([&](const VecX<JetD>& y, const VecX<JetD>& yd, const VecX<JetD>& ydd) -> VecX<JetD> {
        return rnea(s.tree, y, yd, ydd, rnea_ws);
      });
  RneaDerivatives inverse;
  rnea_derivatives(s.tree, q, v, u, inverse);
  CHECK_THAT(inverse.dtau_dq, MatrixNear(of_tau.leftCols(n), kRoundingTol));
  CHECK_THAT(inverse.dtau_dqd, MatrixNear(of_tau.middleCols(n, n), kRoundingTol));
  CHECK_THAT(inverse.M, MatrixNear(of_tau.rightCols(n), kRoundingTol));
  RneaWorkspace<double, double> ws;
  CHECK_THAT(inverse.tau, MatrixNear(rnea(s.tree, q, v, u, ws), kRoundingTol));

  AbaWorkspace<double, JetD> aba_ws;
  const MatX<double> of_qdd =
      slopes([&](const VecX<JetD>& y, const VecX<JetD>& yd, const VecX<JetD>& tau) -> VecX<JetD> {
        return aba(s.tree, y, yd, tau, aba_ws);
      });
  AbaDerivatives forward;
  aba_derivatives(s.tree, q, v, u, forward);
  const double tol = kSolveTol * (1.0 + 1e-3 * of_qdd.cwiseAbs().maxCoeff());
  CHECK_THAT(forward.dqdd_dq, MatrixNear(of_qdd.leftCols(n), tol));
  CHECK_THAT(forward.dqdd_dqd, MatrixNear(of_qdd.middleCols(n, n), tol));
  CHECK_THAT(forward.dqdd_dtau, MatrixNear(of_qdd.rightCols(n), tol));

  ParameterJacobianWorkspace parameter_ws;
  const RowMatX<double> by_inertia =
      forward_dynamics_parameter_jacobian(s.tree, q, v, u, parameter_ws);
  Tree<JetD> heavier = s.tree.cast<JetD>();
  heavier.links[0].inertia.m.v[0] = 1.0;
  heavier.links.back().inertia.I.xy.v[1] = 1.0;
  AbaWorkspace<JetD, double> parameter_aba;
  const VecX<JetD> qdd = aba(heavier, q, v, u, parameter_aba);
  for (int i = 0; i < n; ++i) {
    CHECK(std::abs(by_inertia(i, 0) - qdd[i].v[0]) < tol);
    CHECK(std::abs(by_inertia(i, 10 * (s.tree.num_links() - 1) + 5) - qdd[i].v[1]) < tol);
  }
}

TEST_CASE("free base: a step and its difference undo each other", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const RandomFloating s(seed, {.num_dofs = static_cast<int>(seed % 4)});
  VecX<double> v = s.v;
  v.head<3>() *= 3.0 / (1.0 + v.head<3>().norm());  // below half a turn, beyond which log goes back
  if (seed % 5 == 0) v.head<3>() *= 1e-9;
  const VecX<double> q = integrate(s.tree, s.q, v);
  CHECK(std::abs(q.segment<4>(3).norm() - 1.0) < 1e-14);
  CHECK_THAT(difference(s.tree, s.q, q), MatrixNear(v, kRoundingTol));
  const double h = 1e-6;
  const VecX<double> slope = (integrate<double, double>(s.tree, s.q, h * v) -
                              integrate<double, double>(s.tree, s.q, -h * v)) /
                             (2 * h);
  CHECK_THAT(slope, MatrixNear(rate(s.q, v), 1e-8));
  VecX<double> turned = s.q;  // the same rotation
  turned.segment<4>(3) *= -1.0;
  CHECK_THAT(difference(s.tree, s.q, turned), MatrixNear(0.0 * v, kRoundingTol));
  RneaWorkspace<double, double> ws;
  const VecX<double> tau = rnea(s.tree, s.q, s.v, s.vd, ws);
  CHECK_THAT(rnea(s.tree, turned, s.v, s.vd, ws), MatrixNear(tau, kRoundingTol));
}

TEST_CASE("free base: joints that follow others are the full tree's, projected", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  CAPTURE(seed);
  const RandomFloating full(seed, {.num_dofs = 2 + static_cast<int>(seed % 6)});
  Tree<double> tree = full.tree;
  Rng rng(seed + 500);
  for (int i = 0; i < tree.num_joints(); ++i)
    if (i == 0 || rng.uniform() < 0.5)
      tree.coordinates.joints.push_back({tree.coordinates.count++, 1.0, 0.0});
    else
      tree.coordinates.joints.push_back(
          {static_cast<int>(rng.uniform() * tree.coordinates.count), rng.normal(), rng.normal()});
  const int n = tree.num_velocities();
  MatX<double> G = MatX<double>::Zero(full.tree.num_velocities(), n);
  G.topLeftCorner(6, 6).setIdentity();
  const VecX<double> y = random_positions(rng, tree), v = random_vector(rng, n, 2.0),
                     vd = random_vector(rng, n, 5.0);
  VecX<double> q = full.q;
  q.head<7>() = y.head<7>();
  for (int i = 0; i < tree.num_joints(); ++i) {
    const JointDrive& d = tree.coordinates.joints[i];
    G(6 + i, 6 + d.dof) = d.ratio;
    q[7 + i] = d.ratio * y[7 + d.dof] + d.offset;
  }
  RneaWorkspace<double, double> ws, full_ws;
  const VecX<double> tau = rnea(tree, y, v, vd, ws);
  CHECK_THAT(tau,
             MatrixNear(G.transpose() * rnea(full.tree, q, G * v, G * vd, full_ws), kRoundingTol));
  MassMatrixWorkspace<double, double> mass_ws, full_mass_ws;
  CHECK_THAT(mass_matrix(tree, y, mass_ws),
             MatrixNear(G.transpose() * mass_matrix(full.tree, q, full_mass_ws) * G, kRoundingTol));
  RegressorWorkspace<double, double> Y_ws, full_Y_ws;
  CHECK_THAT(torque_regressor(tree, y, v, vd, Y_ws),
             MatrixNear(G.transpose() * torque_regressor(full.tree, q, G * v, G * vd, full_Y_ws),
                        kRoundingTol));
  AbaWorkspace<double, double> aba_ws;
  CHECK_THAT(aba(tree, y, v, tau, aba_ws), MatrixNear(vd, kSolveTol));
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, y, v, vd, kinematics);
  MatX<double> J;
  const int tip = tree.num_links() - 1;
  frame_jacobian(tree, kinematics, tip, Pose<double>::identity(), J);
  const FrameMotion<double> motion = frame_motion(kinematics, tip, Pose<double>::identity());
  CHECK_THAT(J * v, MatrixNear(stacked(motion.angular_velocity, motion.velocity), kRoundingTol));
}

TEST_CASE("free base: what is no state is refused, by its entries", "[dynamics]") {
  using Catch::Matchers::ContainsSubstring;
  using Catch::Matchers::MessageMatches;
  const RandomFloating s(0);
  RneaWorkspace<double, double> ws;
  CHECK_THROWS_AS(rnea(s.tree, s.q.tail(s.tree.num_dofs()), s.v, s.vd, ws), ShapeError);
  CHECK_THROWS_AS(rnea(s.tree, s.q, s.v.head(6), s.vd, ws), ShapeError);
  for (const double factor : {0.0, 0.5, 1.001, std::nan("")}) {
    VecX<double> q = s.q;
    q.segment<4>(3) *= factor;
    CHECK_THROWS_AS(rnea(s.tree, q, s.v, s.vd, ws), DataError);
    AbaWorkspace<double, double> aba_ws;
    CHECK_THROWS_AS(aba(s.tree, q, s.v, s.tau, aba_ws), DataError);
    CHECK_THROWS_AS(integrate(s.tree, q, s.v), DataError);
  }
  VecX<double> q = s.q;
  q.segment<4>(3) *= 2.0;
  CHECK_THROWS_MATCHES(
      rnea(s.tree, q, s.v, s.vd, ws), DataError,
      MessageMatches(ContainsSubstring("norm 2.0") && ContainsSubstring("rnea: q")));
  Tree<double> tree = free_base_tree(s.tree.links[0].inertia);
  CHECK_THROWS_AS(add_link(tree, {.parent = -1}), ModelError);
  CHECK(add_link(tree, {.parent = 0}) == 1);
}

}  // namespace free_base_test
