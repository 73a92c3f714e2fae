#pragma once
/// camera_delay: the camera's row k shows the ball as it was d earlier, x(t − d); to second order,
/// which leaves d³ |x⃛|/6: 0.02 mm at 10 ms and 100 m/s³.

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

struct CameraDelay {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "camera_delay",
                                  .formula = "x(t - d)",
                                  .summary = "the ball's positions are late against the joints'",
                                  .place = Place::kCamera,
                                  .port = Port::kBallView,
                                  .parameters = {ball_parameter("delay", "s")}};
    return kInfo;
  }

  template <Scalar T>
  void change_view(const BallInstant<T>& x, const T* p, Vec3<T>& seen) const {
    seen = seen - x.ball.v * p[0] + x.acceleration * (p[0] * p[0] * T(0.5));
  }
};

}  // namespace diffnea
