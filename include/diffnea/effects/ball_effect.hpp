#pragma once
/// What effects of the ball, its string and the camera share. Instead of add_torque they have one
/// of
///     add_acceleration(x, p, a)   of the ball, in W [m/s²]                    (Port::kBallForce)
///     change_view(x, p, seen)     where the camera sees it, in the order of
///                                 EffectInfo::view                            (Port::kBallView)
///     delay(p)                    how late its picture is                     (Port::kBallView)
///     add_to_anchor(p, p_LS)      where the string is tied (Port::kStringAnchor)
///     route(ball, knot, cup, p)   the way the string takes around the cup (Port::kStringContact)
///     rebound(p)                  restitution as it becomes taut (Port::kStringContact)
///     clearance(x, radius, p), bounce(p, radius, s, spin)   at a plane (Port::kBallImpact)
/// One that asks for x.anchor_jerk has Trait::kReadsAnchorJerk. One of the string acts while it is
/// taut, with Trait::kWhenSlack while it is slack.

#include <diffnea/dynamics/ball_flight.hpp>
#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// What such an effect may depend on.
template <Scalar T>
struct BallInstant : BallSample<T> {
  Vec3<T> anchor_jerk;   ///< of S [m/s³], where an effect has kReadsAnchorJerk
  Vec3<double> gravity;  ///< in W [m/s²]
  double mass = 0.0;     ///< of the ball [kg]
  double radius = 0.0;   ///< of the ball [m]; 0: not known
};

inline constexpr double kAirDensity = 1.2;  ///< of air at 20 °C, 1013 hPa [kg/m³]

/// A parameter of such an effect: every column is linear in it about 0.
inline ParameterInfo ball_parameter(const char* name, const char* unit, Sign sign = Sign::kFree) {
  return {.name = name, .unit = unit, .unit_prismatic = unit, .sign = sign};
}

/// |v|, smooth below 10 mm/s, where no drag matters.
template <class T>
T speed(const Vec3<T>& v) {
  using std::sqrt;
  return sqrt(dot(v, v) + T(1e-4));
}
/// The part of v across the string.
template <class T>
Vec3<T> across(const BallInstant<T>& x, const Vec3<T>& v) {
  return v - x.u * dot(x.u, v);
}

}  // namespace diffnea
