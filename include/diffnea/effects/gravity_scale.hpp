#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// gravity_scale: the ball falls by (1 + ε) g: a wrong unit of length, a wrong g, buoyancy.
struct GravityScale {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "gravity_scale",
                                  .formula = "eps g",
                                  .summary = "the ball's gravity is another one",
                                  .place = Place::kBall,
                                  .port = Port::kBallForce,
                                  .parameters = {ball_parameter("excess", "1")}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    a = a + x.gravity.template cast<T>() * p[0];
  }
};

}  // namespace diffnea
