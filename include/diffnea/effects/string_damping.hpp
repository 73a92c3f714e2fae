#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// string_damping: what the knot and the string's fibres take from the swing, −c θ̇ of the string's
/// angle.
struct StringDamping {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "string_damping",
        .formula = "-c r d(theta)/dt",
        .summary = "damping of the string's angle",
        .place = Place::kString,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("damping", "1/s", Sign::kNonNegative)}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    if (x.taut) a = a - across(x, x.ball.v - x.anchor.v) * p[0];
  }
};

}  // namespace diffnea
