#pragma once
/// The arm that swings the ball: four joints like a WAM's, which follow a prescribed motion
/// exactly.

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "random.hpp"

namespace hidden {

inline constexpr int kArmJoints = 4;

/// Where a link sits on the one before, about which it then turns by its joint (z of the link).
struct ArmLink {
  std::string name, joint;  ///< joint: empty if it is fixed
  Eigen::Vector3d offset;   ///< in the link before [m]
  Eigen::Vector3d rpy;      ///< of the link in the link before, at 0 [rad]
};
/// Base, four links that turn, cup.
const std::vector<ArmLink>& arm_links();

/// q_j(t) = centre + slow sines (0.05 to 0.3 Hz, which turn upper arm and elbow by about 0.6 rad,
/// so that where the string is tied can be told from its length) + vigour · sines about the
/// pendulum's frequency.
class ArmMotion {
 public:
  /// @param swing_hz  frequency of the pendulum [Hz]
  ArmMotion(Rng rng, double swing_hz);

  double vigour = 1.0;
  struct Angle {
    double q, qd, qdd;
  };
  Angle joint(int joint, double time) const;

 private:
  struct Sine {
    double amplitude, omega, phase;
    bool fast;
  };
  std::array<double, kArmJoints> centre_{};
  std::array<std::vector<Sine>, kArmJoints> sines_;
};

/// The cup's frame in W at one instant: pose, velocities, accelerations.
struct Hand {
  Eigen::Matrix3d R;
  Eigen::Vector3d p, v, a;     ///< of its origin
  Eigen::Vector3d turn, spin;  ///< angular velocity and acceleration
};
Hand hand_at(const ArmMotion& motion, double time);
/// At begin + k·step, k < count.
std::vector<Hand> hands(const ArmMotion& motion, double begin, double step, long count);

/// A point that is fixed to the hand.
struct Anchor {
  Eigen::Vector3d x, v, a;
};
Anchor anchor(const Hand& hand, const Eigen::Vector3d& in_hand);

}  // namespace hidden
