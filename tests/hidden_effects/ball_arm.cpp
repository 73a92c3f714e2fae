#include "ball_arm.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace hidden {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Matrix3d turned(const Eigen::Vector3d& rpy) {
  return (Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace

const std::vector<ArmLink>& arm_links() {
  static const std::vector<ArmLink> kLinks{
      {"base", "", {0.0, 0.0, 0.84}, {0.0, 0.0, 0.0}},
      {"shoulder_yaw", "joint1", {0.0, 0.0, 0.16}, {0.0, 0.0, 0.0}},
      {"shoulder_pitch", "joint2", {0.0, 0.0, 0.184}, {-kPi / 2, 0.0, 0.0}},
      {"upper_arm", "joint3", {0.0, -0.505, 0.0}, {kPi / 2, 0.0, 0.0}},
      {"forearm", "joint4", {0.045, 0.0, 0.045}, {-kPi / 2, 0.0, 0.0}},
      {"cup", "", {-0.00683, -0.4665, 0.0}, {0.0, -kPi / 2, 0.0}}};
  return kLinks;
}

ArmMotion::ArmMotion(Rng rng, double swing_hz) {
  constexpr std::array<double, kArmJoints> kCentre{0.0, 0.6, 0.0, 1.25};
  constexpr std::array<double, kArmJoints> kSlow{0.2, 0.15, 0.6, 0.6};    // [rad]
  constexpr std::array<double, kArmJoints> kFast{0.03, 0.02, 0.0, 0.03};  // [rad]
  constexpr int kSines = 3;
  for (std::size_t j = 0; j < kArmJoints; ++j) {
    centre_[j] = kCentre[j] + rng.uniform(-0.15, 0.15);
    std::array<double, kSines> share{};
    double sum = 0.0;
    for (double& s : share) sum += s = rng.uniform(0.5, 1.0);
    const double slow = rng.uniform(0.85, 1.15) * kSlow[j];
    for (const double s : share)
      sines_[j].push_back(
          {slow * s / sum, 2 * kPi * rng.log_uniform(0.05, 0.3), rng.uniform(0.0, 2 * kPi), false});
    for (int k = 0; k < kSines && kFast[j] > 0.0; ++k) {
      // Beside the pendulum's frequency: on it, nothing would bound the swing.
      const double beside = rng.chance(0.7) ? rng.uniform(0.7, 0.93) : rng.uniform(1.07, 1.25);
      sines_[j].push_back({kFast[j] * rng.uniform(0.5, 1.0), 2 * kPi * swing_hz * beside,
                           rng.uniform(0.0, 2 * kPi), true});
    }
  }
}

ArmMotion::Angle ArmMotion::joint(int joint, double time) const {
  const auto j = static_cast<std::size_t>(joint);
  Angle out{centre_[j], 0.0, 0.0};
  for (const Sine& s : sines_[j]) {
    const double size = s.amplitude * (s.fast ? vigour : 1.0), angle = s.omega * time + s.phase;
    const double sine = size * std::sin(angle);
    out.q += sine;
    out.qd += s.omega * size * std::cos(angle);
    out.qdd -= s.omega * s.omega * sine;
  }
  return out;
}

Hand hand_at(const ArmMotion& motion, double time) {
  Hand h{Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
         Eigen::Vector3d::Zero(),     Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  static const std::vector<Eigen::Matrix3d> kTurned = [] {
    std::vector<Eigen::Matrix3d> out;
    for (const ArmLink& link : arm_links()) out.push_back(turned(link.rpy));
    return out;
  }();
  int j = 0;
  for (std::size_t i = 0; i < arm_links().size(); ++i) {
    const ArmLink& link = arm_links()[i];
    const Anchor at = anchor(h, link.offset);
    h.p = at.x;
    h.v = at.v;
    h.a = at.a;
    h.R = (h.R * kTurned[i]).eval();
    if (link.joint.empty()) continue;
    const Eigen::Vector3d axis = h.R.col(2);
    const ArmMotion::Angle at_joint = motion.joint(j, time);
    h.spin += axis * at_joint.qdd + h.turn.cross(axis) * at_joint.qd;
    h.turn += axis * at_joint.qd;
    h.R = h.R * Eigen::AngleAxisd(at_joint.q, Eigen::Vector3d::UnitZ());
    ++j;
  }
  return h;
}

std::vector<Hand> hands(const ArmMotion& motion, double begin, double step, long count) {
  std::vector<Hand> out;
  out.reserve(static_cast<std::size_t>(count));
  for (long k = 0; k < count; ++k)
    out.push_back(hand_at(motion, begin + step * static_cast<double>(k)));
  return out;
}

Anchor anchor(const Hand& hand, const Eigen::Vector3d& in_hand) {
  const Eigen::Vector3d d = hand.R * in_hand, swept = hand.turn.cross(d);
  return {hand.p + d, hand.v + swept, hand.a + hand.spin.cross(d) + hand.turn.cross(swept)};
}

}  // namespace hidden
