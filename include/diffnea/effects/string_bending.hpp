#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// string_bending: a knot that is stiff pulls the string toward hanging straight down,
/// tangential k r (ĝ − u): like more gravity, at the angle alone. Without gravity there is no down,
/// and no pull.
struct StringBending {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "string_bending",
        .formula = "k r (g/|g|)_tangential",
        .summary = "stiffness of the knot against the string's angle",
        .place = Place::kString,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("stiffness", "1/s^2", Sign::kNonNegative)}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    const double g = std::sqrt(dot(x.gravity, x.gravity));
    if (!x.taut || !(g > 0.0)) return;
    const Vec3<double> down = x.gravity * (1.0 / g);
    a = a + across(x, down.template cast<T>()) * (p[0] * x.length);
  }
};

}  // namespace diffnea
