#pragma once
/// string_extension: a string that gives, r + c T with its tension T. Quasi-static: the ball is
/// seen c T further out; that its own swing (up to 20 Hz) is fast against the motion is assumed.

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

struct StringExtension {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "string_extension",
        .formula = "r + c T",
        .summary = "elastic string",
        .place = Place::kString,
        .port = Port::kBallView,
        .parameters = {ball_parameter("compliance", "m/N", Sign::kNonNegative)}};
    return kInfo;
  }

  template <Scalar T>
  void change_view(const BallInstant<T>& x, const T* p, Vec3<T>& seen) const {
    if (x.taut) seen = seen + x.u * (p[0] * T(x.mass) * x.pull);
  }
};

}  // namespace diffnea
