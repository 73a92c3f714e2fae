#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// string_extension: a string that gives, r + c (T − m g) with its tension T; r is its length under
/// the ball's weight. Quasi-static: that the ball's bouncing on the string (10 Hz and more) is fast
/// against the motion is assumed. With δ = c (T − m g), the ball is seen δ further out, and turns
/// as a pendulum of length r + δ(t) does, to first order in c:
///
///   a_tangential (1 − δ/r) − 2 (δ̇/r) v_tangential,   T = m (uᵀ(g − ẍ_S) + ‖v‖²/r), v against S
struct StringExtension {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "string_extension",
        .formula = "r + c (T - m g)",
        .summary = "elastic string",
        .place = Place::kString,
        .port = Port::kBallForce,
        .parameters = {ball_parameter("compliance", "m/N", Sign::kNonNegative)},
        .traits = {Trait::kReadsAnchorJerk}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    if (!x.taut) return;
    const Vec3<T> g = x.gravity.template cast<T>(), free = g - x.anchor.a,
                  v = across(x, x.ball.v - x.anchor.v), tangential = across(x, free);
    const T per = T(1.0) / x.length, stretch = p[0] * T(x.mass) * per;
    // Ṫ/m = u̇ᵀ(g − ẍ_S) − uᵀx⃛_S + 2 vᵀv̇/r, u̇ = v/r, v̇ = the tangential acceleration
    const T rate = dot(v, free) * per - dot(x.u, x.anchor_jerk) + T(2.0) * dot(v, tangential) * per;
    a = a - tangential * (stretch * excess(x)) - v * (T(2.0) * stretch * rate);
  }

  template <Scalar T>
  void change_view(const BallInstant<T>& x, const T* p, Vec3<T>& seen) const {
    if (x.taut) seen = seen + x.u * (p[0] * T(x.mass) * excess(x));
  }

 private:
  /// T/m − |g| [m/s²].
  template <Scalar T>
  static T excess(const BallInstant<T>& x) {
    const Vec3<T> v = x.ball.v - x.anchor.v;
    return dot(x.u, x.gravity.template cast<T>() - x.anchor.a) + dot(v, v) / x.length -
           T(std::sqrt(dot(x.gravity, x.gravity)));
  }
};

}  // namespace diffnea
