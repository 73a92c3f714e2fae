#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// linear_drag: air drag of slow motion, −c₁ v, v the ball's velocity in W.
struct LinearDrag {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "linear_drag",
        .formula = "-c1 v",
        .summary = "air drag proportional to the ball's velocity",
        .place = Place::kBall,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("drag", "1/s", Sign::kNonNegative)}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    a = a - x.ball.v * p[0];
  }
};

}  // namespace diffnea
