#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// wind: a constant acceleration w of the ball, in W.
struct Wind {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "wind",
        .formula = "w",
        .summary = "constant acceleration of the ball",
        .place = Place::kBall,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("wind_x", "m/s^2"), ball_parameter("wind_y", "m/s^2"),
                       ball_parameter("wind_z", "m/s^2")}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>&, const T* p, Vec3<T>& a) const {
    a = a + Vec3<T>{p[0], p[1], p[2]};
  }
};

}  // namespace diffnea
