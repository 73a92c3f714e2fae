#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// camera_rotation: the camera's frame is turned by a small ρ against the world's, (1 + [ρ]×) x.
struct CameraRotation {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "camera_rotation",
        .formula = "(1 + [rho]) x",
        .summary = "the camera's frame is turned against the world's",
        .place = Place::kCamera,
        .port = Port::kBallView,
        .parameters = {ball_parameter("rotation_x", "rad"), ball_parameter("rotation_y", "rad"),
                       ball_parameter("rotation_z", "rad")},
        .view = ViewStage::kRotation};
    return kInfo;
  }

  template <Scalar T>
  void change_view(const BallInstant<T>&, const T* p, Vec3<T>& seen) const {
    seen = seen + cross(Vec3<T>{p[0], p[1], p[2]}, seen);
  }
};

}  // namespace diffnea
