#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// camera_scale: the camera's unit of length is off, (1 + σ) x about the world's origin.
struct CameraScale {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "camera_scale",
                                  .formula = "(1 + sigma) x",
                                  .summary = "the camera's unit of length is off",
                                  .place = Place::kCamera,
                                  .port = Port::kBallView,
                                  .parameters = {ball_parameter("excess", "1")},
                                  .view = ViewStage::kScale};
    return kInfo;
  }

  template <Scalar T>
  void change_view(const BallInstant<T>&, const T* p, Vec3<T>& seen) const {
    seen = seen + seen * p[0];
  }
};

}  // namespace diffnea
