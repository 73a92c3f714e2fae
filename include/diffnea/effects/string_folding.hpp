#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// string_folding: fibres that resist being bent push back while a string folds, and hold back
/// while it unfolds: κ ṡ/(s + s₀) along u, with the slack s = r − ‖Δ‖. A string of rigid pieces
/// with friction b in every joint folds by the angle θ ∝ √s, so that the power b θ̇² ∝ b ṡ²/s is
/// that of a force ∝ b ṡ/s. s₀ stands for how straight it was.
struct StringFolding {
  static constexpr double kStraight = 5e-4;  ///< s₀ [m]

  static const EffectInfo& info() {
    static const EffectInfo kInfo = [] {
      EffectInfo out{.name = "string_folding",
                     .formula = "k (ds/dt)/(s + s_0) along the slack string, s = r - |x - x_S|",
                     .summary = "resistance of a slack string to being folded and unfolded",
                     .place = Place::kString,
                     .port = Port::kBallForce,
                     .parameters = {ball_parameter("resistance", "m/s", Sign::kNonNegative)},
                     .traits = {Trait::kWhenSlack}};
      out.parameters[0].most = 0.1;  // steps of 10 ms are stable up to there
      out.parameters[0].search = {0.02};
      return out;
    }();
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    if (x.taut) return;
    const Vec3<T> delta = x.ball.x - x.anchor.x;
    const T left = x.length - dot(x.u, delta), slack = select(left > T(0.0), left, T(0.0));
    const T rate = -dot(x.u, x.ball.v - x.anchor.v);
    a = a + x.u * (p[0] * rate / (slack + T(kStraight)));
  }
};

}  // namespace diffnea
