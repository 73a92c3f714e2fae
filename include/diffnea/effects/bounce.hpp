#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// bounce: off a level plane at a height, the table. Along its normal n the velocity is reversed
/// and multiplied by e; across it, Coulomb friction μ acts on the point of contact until that no
/// longer slips (Garwin 1969); the ball is a thin shell, I = ⅔ m r²:
///
///   u = v_t + ω × (−r n),   Δv_t = −min(μ (1 + e)|v_n|, ⅖ |u|) u/|u|,   Δω = (3/(2r)) Δv_t × n
struct Bounce {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "bounce",
                                  .formula = "v_n <- -e v_n; friction mu (1 + e) |v_n| at most",
                                  .summary = "restitution and friction at a level plane",
                                  .place = Place::kBall,
                                  .port = Port::kBallImpact,
                                  .parameters = {{.name = "restitution",
                                                  .unit = "1",
                                                  .unit_prismatic = "1",
                                                  .sign = Sign::kNonNegative,
                                                  .linear = false,
                                                  .initial = 0.9,
                                                  .most = 1.0},
                                                 {.name = "friction",
                                                  .unit = "1",
                                                  .unit_prismatic = "1",
                                                  .sign = Sign::kNonNegative,
                                                  .linear = false,
                                                  .initial = 0.2},
                                                 {.name = "height",
                                                  .unit = "m",
                                                  .unit_prismatic = "m",
                                                  .linear = false,
                                                  .initial = 0.0}},
                                  .traits = {Trait::kJumps}};
    return kInfo;
  }

  /// Of the ball's lowest point over the plane [m].
  template <Scalar T>
  T clearance(const ParticleState<T>& s, double radius, const T* p) const {
    return s.x.z - T(radius) - p[2];
  }

  /// The impact of a ball that touches the plane: puts it onto the plane and, if it moves down,
  /// changes its velocity and its spin ω [rad/s], both in W. It leaves with 20 mm/s at least.
  template <Scalar T>
  void bounce(const T* p, double radius, ParticleState<T>& s, Vec3<T>& spin) const {
    using std::sqrt;
    const T down = -s.v.z;
    s.x.z = p[2] + T(radius);
    if (!(value(down) > 0.0)) return;
    // A ball that comes to rest would bounce without end.
    const T up = value(p[0]) * value(down) > kLeast ? p[0] * down : T(kLeast);
    const T r(radius);
    const T ux = s.v.x - spin.y * r, uy = s.v.y + spin.x * r;  // ω × (−r ẑ) = (−ω_y, ω_x, 0) r
    const T slip = sqrt(ux * ux + uy * uy + T(1e-12));
    const T slides = p[1] * (down + up), grips = slip * T(0.4);
    const T lost = value(slides) < value(grips) ? slides : grips;
    const T dx = -lost * ux / slip, dy = -lost * uy / slip;
    s.v = {s.v.x + dx, s.v.y + dy, up};
    if (radius > 0.0) {
      const T per = T(1.5 / radius);  // (dx, dy, 0) × ẑ = (dy, −dx, 0)
      spin = {spin.x + per * dy, spin.y - per * dx, spin.z};
    }
  }

 private:
  static constexpr double kLeast = 0.02;  ///< velocity up after a bounce [m/s]
};

}  // namespace diffnea
