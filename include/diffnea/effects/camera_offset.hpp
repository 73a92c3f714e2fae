#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// camera_offset: the camera's origin is not the world's, x + t.
struct CameraOffset {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "camera_offset",
        .formula = "x + t",
        .summary = "the camera's origin is not the world's",
        .place = Place::kCamera,
        .port = Port::kBallView,
        .parameters = {ball_parameter("offset_x", "m"), ball_parameter("offset_y", "m"),
                       ball_parameter("offset_z", "m")},
        .view = ViewStage::kOffset};
    return kInfo;
  }

  template <Scalar T>
  void change_view(const BallInstant<T>&, const T* p, Vec3<T>& seen) const {
    seen = seen + Vec3<T>{p[0], p[1], p[2]};
  }
};

}  // namespace diffnea
