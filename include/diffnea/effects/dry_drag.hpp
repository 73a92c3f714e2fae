#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// dry_drag: a drag of constant size against the motion, −μ v̂, smooth below 10 mm/s.
struct DryDrag {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "dry_drag",
        .formula = "-mu v/|v|",
        .summary = "drag of constant size against the ball's motion",
        .place = Place::kBall,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("drag", "m/s^2", Sign::kNonNegative)}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    a = a - x.ball.v * (p[0] / speed(x.ball.v));
  }
};

}  // namespace diffnea
