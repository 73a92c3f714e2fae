#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// quadratic_drag: air drag −c₂ |v| v; c₂ = ½ ρ C_D A/m of a ball.
struct QuadraticDrag {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "quadratic_drag",
        .formula = "-c2 |v| v",
        .summary = "air drag proportional to the square of the ball's velocity",
        .place = Place::kBall,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("drag", "1/m", Sign::kNonNegative)}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    a = a - x.ball.v * (p[0] * speed(x.ball.v));
  }
};

}  // namespace diffnea
