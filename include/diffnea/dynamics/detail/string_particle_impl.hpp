#pragma once

#include <diffnea/core/softplus.hpp>
#include <diffnea/dynamics/string_particle.hpp>

namespace diffnea {

template <Scalar T>
T string_pull(const ParticleState<T>& ball, const AnchorMotion<T>& anchor, const Vec3<T>& a,
              const T& length, const StringSmoothing& smoothing) {
  using std::sqrt;
  const Vec3<T> delta = ball.x - anchor.x, delta_d = ball.v - anchor.v;
  const T squared = dot(delta, delta), distance = sqrt(squared), h = squared - length * length,
          hd = dot(delta, delta_d) * T(2.0);
  const double kp = 1.0 / (smoothing.settle * smoothing.settle), kd = 2.0 / smoothing.settle;
  const T restoring = h * T(-kp) - hd * T(kd);  // ḧ* = min(0, ·)
  const T wanted = value(restoring) < 0.0 ? restoring : T(0.0);
  const T pull = (dot(delta, a - anchor.a) + dot(delta_d, delta_d) - wanted * T(0.5)) / distance;
  if (smoothing.softness == Softness::kHard)
    return value(h) >= 0.0 && value(pull) > 0.0 ? pull : T(0.0);
  return sigmoid((distance - length) * T(smoothing.switching)) *
         softplus(pull * T(smoothing.pull)) * T(1.0 / smoothing.pull);
}

template <Scalar T>
Vec3<T> string_acceleration(const ParticleState<T>& ball, const AnchorMotion<T>& anchor,
                            const Vec3<T>& a, const T& length, const StringSmoothing& smoothing) {
  using std::sqrt;
  const Vec3<T> delta = ball.x - anchor.x;
  const T pull = string_pull(ball, anchor, a, length, smoothing);
  return a - delta * (pull / sqrt(dot(delta, delta)));
}

}  // namespace diffnea
