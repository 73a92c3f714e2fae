#pragma once
/// A ball on a string, step by step: what dynamics/ball_flight.hpp does with events, in steps of
/// fixed length that are the same for every lane of a pack.
///
/// Velocity Verlet with the string as an inequality (RATTLE, Andersen 1983, on one side): a ball
/// that a step takes beyond r is put back on the sphere, and loses the velocity away from the
/// anchor. A string that becomes taut is so an impact without restitution; one that is left inward
/// becomes slack by itself; nothing is ever stretched, and no stiffness limits the step. Second
/// order while nothing switches.

#include <diffnea/dynamics/string_particle.hpp>

namespace diffnea {

/// @tparam Mask  what comparisons of T give: bool, or one bool a lane
template <Scalar T, class Mask>
struct StringBall {
  ParticleState<T> ball;               ///< in W, at the end of the last step
  Vec3<T> a;                           ///< acceleration without the string, at the state
  Mask taut;                           ///< the last step ended on the sphere
  T pull = T(0.0);                     ///< velocity that the string took in the last step [m/s]
  Vec3<T> u{T(0.0), T(0.0), T(-1.0)};  ///< from the anchor to the ball, of length 1
};

/// One step of h [s].
/// @param end  the anchor at the end of the step; its acceleration is not read
/// @param acceleration  (ball, u, taut) → of the ball without the string, W [m/s²]
/// @param restitution  of the impact of becoming taut, above kRestSpeed; null: none
template <Scalar T, class Mask, class Acceleration>
void step_string_ball(StringBall<T, Mask>& s, const AnchorMotion<T>& end, const T& length, double h,
                      const Acceleration& acceleration, const T* restitution = nullptr) {
  using std::sqrt;
  constexpr double kRestSpeed = 0.01;  // [m/s]
  const Mask was_taut = s.taut;
  const T zero(0.0), half(0.5 * h);
  Vec3<T> v = s.ball.v + s.a * half, x = s.ball.x + v * T(h);
  const Vec3<T> delta = x - end.x;
  const T distance = sqrt(dot(delta, delta));
  s.taut = distance > length;
  s.u = delta * (T(1.0) / distance);
  const T beyond = select(s.taut, T(distance - length), zero);
  x = x - s.u * beyond;
  v = v - s.u * (beyond * T(1.0 / h));
  s.a = acceleration(ParticleState<T>{x, v}, s.u, s.taut);
  v = v + s.a * half;
  const T away = dot(s.u, v - end.v);
  T lost = select(s.taut && away > zero, away, zero);
  if (restitution) {
    const T outward = beyond * T(1.0 / h) + lost;
    const Mask impact = s.taut && !was_taut && outward > T(kRestSpeed);
    lost = lost + select(impact, T(*restitution * outward), zero);
  }
  s.ball = {x, v - s.u * lost};
  s.pull = beyond * T(1.0 / h) + lost;
}

}  // namespace diffnea
