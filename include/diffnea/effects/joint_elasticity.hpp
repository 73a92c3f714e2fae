#pragma once
/// joint_elasticity: a spring between motor and link. The encoder reads the link's angle q; the
/// motor's, θ, is hidden: K(θ − q) + D(θ̇ − q̇) = τ, the torque the links transmit. The rotor turns
/// with θ, so the log has J_m(θ̈ − q̈) more than the base model, whose armature turns with q; J_m is
/// the part of that armature behind the spring (all of it, in a drive). θ − q is τ/K through a
/// first-order lag D/K (Spong 1987 for D = 0). Without damping the torque tells J_m/K alone: hold
/// one of the two.

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

struct JointElasticity {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "joint_elasticity",
        .formula = "J_m (thdd - qdd), K (th - q) + D (thd - qd) = tau",
        .summary = "spring between motor and link; the motor's angle is hidden",
        .port = Port::kMemory,
        .parameters = {{.name = "stiffness",
                        .unit = "N*m/rad",
                        .unit_prismatic = "N/m",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 1e3,
                        .initial_prismatic = 1e5,
                        .search = log_grid(100.0, 1e5, 7),
                        .search_prismatic = log_grid(1e4, 1e7, 7)},
                       {.name = "damping",
                        .unit = "N*m*s/rad",
                        .unit_prismatic = "N*s/m",
                        .sign = Sign::kNonNegative,
                        .linear = false},
                       {.name = "motor_inertia",
                        .unit = "kg*m^2",
                        .unit_prismatic = "kg",
                        .sign = Sign::kNonNegative}},
        .motor_side = true};
    return kInfo;
  }

  /// θ − q (N) [rad].
  VecX<double> deflection(const JointSeries& x, int joint, const double* p) const {
    return low_passed(x.tau.col(joint), x.dt, p[1] / p[0]) / p[0];
  }

  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    return p[2] * derivative(derivative(deflection(x, joint, p), x.dt), x.dt);
  }
};

}  // namespace diffnea
