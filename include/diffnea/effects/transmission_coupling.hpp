#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// transmission_coupling: a shaft that two joints turn together, at w = q̇ᵢ + ρ q̇ⱼ, as in coupled
/// wrists, with inertia, viscous and dry friction f = J ẇ + b w + F_c tanh(w/v₀). Its power is f w
/// = τᵢq̇ᵢ + τⱼq̇ⱼ, so τᵢ = f and τⱼ = ρ f (the Stäubli TX40's joints 5 and 6: ρ = 1).
struct TransmissionCoupling {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "transmission_coupling",
        .formula = "f = J dw/dt + b w + F_c tanh(w/v0) at w = qd_i + rho qd_j",
        .summary = "inertia and friction of a shaft that two joints turn together",
        .place = Place::kJointPair,
        .parameters =
            {{.name = "armature",
              .unit = "kg*m^2",
              .unit_prismatic = "kg",
              .sign = Sign::kNonNegative},
             {.name = "viscous",
              .unit = "N*m*s/rad",
              .unit_prismatic = "N*s/m",
              .sign = Sign::kNonNegative},
             {.name = "coulomb", .unit = "N*m", .unit_prismatic = "N", .sign = Sign::kNonNegative},
             {.name = "ratio",
              .unit = "1",
              .unit_prismatic = "1",
              .linear = false,
              .initial = 1.0,
              .search = {-1.0, 1.0}},
             smoothing_parameter()},
        .motor_side = true,
        .traits = {Trait::kReadsAcceleration},
        .shown_over = {ShownOver::kAcceleration, ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T& ratio = p[3];
    const T speed = x.qd[joint[0]] + ratio * x.qd[joint[1]];
    const T acceleration = x.qdd[joint[0]] + ratio * x.qdd[joint[1]];
    const T f = p[0] * acceleration + p[1] * speed + p[2] * smooth_sign(speed / p[4]);
    tau[joint[0]] += f;
    tau[joint[1]] += ratio * f;
  }
};

}  // namespace diffnea
