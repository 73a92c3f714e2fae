#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/kinematics.hpp>

#include "support/jet_jacobian.hpp"
#include "support/matrix_near.hpp"
#include "support/random_arm.hpp"

namespace kinematics_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// Sums of a few hundred products of order 10²: rounding leaves 1e-13 (observed), 10² of margin.
constexpr double kRoundingTol = 1e-11;
/// Central differences in time, h = 1e-4 s: truncation is h²/6 times a third derivative of order
/// 10³.
constexpr double kTimeStep = 1e-4;
constexpr double kVelocityTol = 1e-4;
/// Second differences of positions of order 1 lose 1e-16/h² = 1e-8 to rounding; h²/12 times a
/// fourth derivative of order 10⁵ weighs more.
constexpr double kAccelerationTol = 1e-2;

/// Position and rotation of F at time t along q(t) = q + q̇t + ½q̈t².
Pose<double> pose_at(const RandomArm& arm, int link, const Pose<double>& X_LF, double t) {
  LinkKinematics<double> kinematics;
  const VecX<double> q = arm.q + arm.qd * t + arm.qdd * (0.5 * t * t);
  forward_kinematics<double, double>(arm.tree, q, kinematics);
  return frame_pose(kinematics, link, X_LF);
}

}  // namespace

TEST_CASE("kinematics: frame velocity and acceleration are time derivatives of its pose",
          "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 4});
  Rng rng(100 + seed);
  const Pose<double> X_LF = random_pose(rng);
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(arm.tree, arm.q, arm.qd, arm.qdd, kinematics);
  for (int link = 0; link < 4; ++link) {
    CAPTURE(link);
    const FrameMotion<double> motion = frame_motion(kinematics, link, X_LF);
    const Pose<double> before = pose_at(arm, link, X_LF, -kTimeStep);
    const Pose<double> now = pose_at(arm, link, X_LF, 0.0);
    const Pose<double> after = pose_at(arm, link, X_LF, kTimeStep);
    const Eigen::Vector3d velocity = to_eigen(after.p - before.p) / (2.0 * kTimeStep);
    const Eigen::Vector3d acceleration =
        to_eigen(after.p + before.p - now.p * 2.0) / (kTimeStep * kTimeStep);
    CHECK_THAT(to_eigen(motion.velocity), MatrixNear(velocity, kVelocityTol));
    CHECK_THAT(to_eigen(motion.acceleration), MatrixNear(acceleration, kAccelerationTol));
    // Ṙ = [ω] R,  R̈ = ([α] + [ω][ω]) R
    const Eigen::Matrix3d R = to_eigen(now.R), w = to_eigen(skew(motion.angular_velocity));
    const Eigen::Matrix3d al = to_eigen(skew(motion.angular_acceleration));
    CHECK_THAT(w * R, MatrixNear((to_eigen(after.R) - to_eigen(before.R)) / (2.0 * kTimeStep),
                                 kVelocityTol));
    CHECK_THAT((al + w * w) * R, MatrixNear((to_eigen(after.R) + to_eigen(before.R) - 2.0 * R) /
                                                (kTimeStep * kTimeStep),
                                            kAccelerationTol));
  }
}

TEST_CASE("kinematics: accelerations of rnea and aba are free of gravity once read", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed);
  LinkKinematics<double> truth, read;
  forward_kinematics<double, double>(arm.tree, arm.q, arm.qd, arm.qdd, truth);
  const auto same = [&] {
    for (int i = 0; i < arm.tree.num_dofs(); ++i) {
      CAPTURE(i);
      const FrameMotion<double> a = frame_motion(truth, i, Pose<double>::identity());
      const FrameMotion<double> b = frame_motion(read, i, Pose<double>::identity());
      CHECK_THAT(to_eigen(b.X_WF.p), MatrixNear(to_eigen(a.X_WF.p), kRoundingTol));
      CHECK_THAT(to_eigen(b.velocity), MatrixNear(to_eigen(a.velocity), kRoundingTol));
      CHECK_THAT(to_eigen(b.acceleration), MatrixNear(to_eigen(a.acceleration), 10 * kRoundingTol));
      CHECK_THAT(to_eigen(b.angular_acceleration),
                 MatrixNear(to_eigen(a.angular_acceleration), 10 * kRoundingTol));
    }
  };
  RneaWorkspace<double, double> rnea_ws;
  const VecX<double> tau = rnea(arm.tree, arm.q, arm.qd, arm.qdd, rnea_ws);
  forward_kinematics(arm.tree, rnea_ws, read);
  same();
  AbaWorkspace<double, double> aba_ws;
  aba(arm.tree, arm.q, arm.qd, tau, aba_ws);
  forward_kinematics(arm.tree, aba_ws, read);
  same();
}

TEST_CASE("kinematics: the frame Jacobian maps joint rates to the frame's velocity", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const RandomArm arm(seed);
  Rng rng(200 + seed);
  const Pose<double> X_LF = random_pose(rng);
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(arm.tree, arm.q, arm.qd, arm.qdd, kinematics);
  MatX<double> J;
  for (int link = -1; link < arm.tree.num_dofs(); ++link) {
    CAPTURE(link);
    frame_jacobian(arm.tree, kinematics, link, X_LF, J);
    const FrameMotion<double> motion = frame_motion(kinematics, link, X_LF);
    Eigen::Matrix<double, 6, 1> velocity;
    velocity << to_eigen(motion.angular_velocity), to_eigen(motion.velocity);
    CHECK_THAT(J * arm.qd, MatrixNear(velocity, kRoundingTol));
  }
}

TEST_CASE("kinematics: a frame's attachment can be a Jet while the links are double",
          "[dynamics]") {
  const RandomArm arm(7);
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(arm.tree, arm.q, arm.qd, arm.qdd, kinematics);
  const VecX<double> p = VecX<double>::Constant(3, 0.2);
  const auto acceleration = [&](const auto& x) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    const Pose<T> X_LF{Mat3<T>::identity(), {x[0], x[1], x[2]}};
    const Vec3<T> a = frame_motion(kinematics, 5, X_LF).acceleration;
    VecX<T> out(3);
    out << a.x, a.y, a.z;
    return out;
  };
  // ẍ is affine in p: the difference quotient is exact but for rounding.
  CHECK_THAT(jet_jacobian(p, acceleration),
             MatrixNear(central_jacobian(p, 0.5, acceleration), 1e-9));
}

}  // namespace kinematics_test
