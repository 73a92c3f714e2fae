#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// camera_delay: the camera's row k shows the ball as it was d earlier, x(t − d).
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
  T delay(const T* p) const {
    return p[0];
  }
};

}  // namespace diffnea
