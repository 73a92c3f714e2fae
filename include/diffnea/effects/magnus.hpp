#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// magnus: the lift of a spinning ball, C_M ρ A r/m · ω×v, with the spin ω of the recording
/// (spin_x, spin_y, spin_z) and ρ = 1.2 kg/m³, A = πr² (Rubinow and Keller 1961 for the form).
struct Magnus {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "magnus",
                                  .formula = "C_M rho A r/m (omega x v)",
                                  .summary = "lift of a spinning ball; needs its recorded spin",
                                  .place = Place::kBall,
                                  .port = Port::kBallForce,
                                  .parameters = {ball_parameter("magnus", "1")},
                                  .traits = {Trait::kNeedsSpin}};
    return kInfo;
  }

  template <Scalar T>
  void add_acceleration(const BallInstant<T>& x, const T* p, Vec3<T>& a) const {
    if (!(x.mass > 0.0)) return;
    const double r = x.radius, per_unit = kAirDensity * M_PI * r * r * r / x.mass;
    a = a + cross(x.spin, x.ball.v) * (p[0] * T(per_unit));
  }
};

}  // namespace diffnea
