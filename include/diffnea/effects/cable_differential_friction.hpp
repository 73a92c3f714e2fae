#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// cable_differential_friction: friction of the two shafts of a cable differential, which turn at
/// w± = q̇ᵢ ± ρ q̇ⱼ, each with f(w) = F_c tanh(w/v₀) + b w. Power is conserved, f₊w₊ + f₋w₋ = τᵢq̇ᵢ +
/// τⱼq̇ⱼ, so τᵢ = f₊ + f₋ and τⱼ = ρ(f₊ − f₋). Barrett WAM: joints 2 and 3, ρ = 1/1.68.
struct CableDifferentialFriction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "cable_differential_friction",
        .formula = "f(w) = F_c tanh(w/v0) + b w at w = qd_i +- rho qd_j",
        .summary = "friction of the shafts of a cable differential that drives two joints",
        .place = Place::kJointPair,
        .parameters =
            {{.name = "coulomb", .unit = "N*m", .unit_prismatic = "N", .sign = Sign::kNonNegative},
             {.name = "viscous",
              .unit = "N*m*s/rad",
              .unit_prismatic = "N*s/m",
              .sign = Sign::kNonNegative},
             {.name = "ratio",
              .unit = "1",
              .unit_prismatic = "1",
              .sign = Sign::kPositive,
              .linear = false,
              .initial = 1.0 / 1.68,
              .search = {1.0 / 1.68, 1.0, 1.68}},
             smoothing_parameter()},
        .motor_side = true,
        .reads = Reads::kSpeed,
        .shown_over = {ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T &coulomb = p[0], &viscous = p[1], &ratio = p[2], &smoothing = p[3];
    const T plus = x.qd[joint[0]] + ratio * x.qd[joint[1]];
    const T minus = x.qd[joint[0]] - ratio * x.qd[joint[1]];
    const T f_plus = coulomb * smooth_sign(plus / smoothing) + viscous * plus;
    const T f_minus = coulomb * smooth_sign(minus / smoothing) + viscous * minus;
    tau[joint[0]] += f_plus + f_minus;
    tau[joint[1]] += ratio * (f_plus - f_minus);
  }
};

}  // namespace diffnea
