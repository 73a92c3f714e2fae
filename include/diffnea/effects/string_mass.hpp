#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// string_mass: a straight string with a mass of its own, λr = μ m, turns about its anchor as a rod
/// with the ball at its end: tangential (g − ẍ_S) times (1 + μ/2)/(1 + μ/3).
struct StringMass {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "string_mass",
        .formula = "(g - a_S)_tangential ((1 + mu/2)/(1 + mu/3) - 1)",
        .summary = "mass of the string over the ball's",
        .place = Place::kString,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("mass_ratio", "1", Sign::kNonNegative)}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    if (!x.taut) return;
    const T excess = (T(1.0) + p[0] * T(0.5)) / (T(1.0) + p[0] * T(1.0 / 3.0)) - T(1.0);
    a = a + across(x, x.gravity.template cast<T>() - x.anchor.a) * excess;
  }
};

}  // namespace diffnea
