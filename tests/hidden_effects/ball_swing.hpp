#pragma once
/// A ball on a string, simulated. The string is a spring with a damper that only pull: so stiff
/// that it gives 0.02 mm under the ball's weight, or as soft as a hidden compliance says. Slack and
/// taut need no case of their own. A string with mass is a straight one: with u the share of the
/// way from anchor S to ball, its points move by ẋ_S + u (ẋ − ẋ_S), and Lagrange's equation is
///
///   (m + λ/3) ẍ + λ/6 ẍ_S = (m + λ/2) g + forces,  λ its mass

#include <vector>

#include "ball_arm.hpp"

namespace hidden {

inline constexpr double kSwingStep = 2.5e-4;  ///< [s]
inline constexpr double kGravity = 9.81;      ///< [m/s²]

/// The ball's world; what hides is 0 where it does not.
struct BallWorld {
  double mass = 0.024;                                       ///< [kg]
  double length = 0.4;                                       ///< of the string [m]
  Eigen::Vector3d attachment = Eigen::Vector3d::Zero();      ///< of the string, in the hand [m]
  double linear_drag = 0.0, quadratic_drag = 0.0;            ///< [1/s], [1/m]
  double dry_drag = 0.0;                                     ///< [m/s²]
  Eigen::Vector3d wind = Eigen::Vector3d::Zero();            ///< [m/s²]
  double gravity_excess = 0.0;                               ///< [1]
  double compliance = 0.0;                                   ///< of the string [m/N]
  double mass_ratio = 0.0;                                   ///< string over ball [1]
  double damping = 0.0;                                      ///< of the string's angle [1/s]
  double stiffness = 0.0;                                    ///< of the knot [1/s²]
  Eigen::Vector3d attachment_off = Eigen::Vector3d::Zero();  ///< added to the attachment [m]
  double camera_delay = 0.0;                                 ///< [s]
  double camera_excess = 0.0;                                ///< [1]
  Eigen::Vector3d camera_turn = Eigen::Vector3d::Zero();     ///< [rad]
  Eigen::Vector3d camera_off = Eigen::Vector3d::Zero();      ///< [m]
};

struct BallState {
  Eigen::Vector3d x, v;
};

/// How far the string gives under a pull [m/N].
double give(const BallWorld& world);
/// The string's pull on the ball [N].
double tension(const BallWorld& world, const Anchor& anchor, const BallState& state);

/// States 0 … steps, one every kSwingStep (Runge–Kutta 4).
/// @param hands  every half step from the first state on, 2 steps + 1 at least
std::vector<BallState> swing(const BallWorld& world, const Hand* hands, long steps,
                             BallState state);

/// What the camera shows at a fractional step of a path.
Eigen::Vector3d seen(const BallWorld& world, const std::vector<BallState>& path, double step);

}  // namespace hidden
