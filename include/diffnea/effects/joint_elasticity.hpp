#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// joint_elasticity: a spring between motor and link. The encoder reads the link's angle q; the
/// motor's, θ, is hidden: K(θ − q) + D(θ̇ − q̇) = τ_s, the torque that the link's side takes: what
/// the links transmit and the friction there, 1 − friction_share of the joint's. Its jumps wind the
/// spring up as well; the rest of the friction turns with the motor. The rotor turns with θ, so the
/// log has J_m(θ̈ − q̈) more than the base model, whose armature turns with q; J_m is the part of
/// that armature behind the spring (all of it, in a drive). θ − q is τ_s/K through a first-order
/// lag D/K (Spong 1987 for D = 0 and a friction_share of 1). Without damping and friction the
/// torque tells J_m/K alone: hold one of the two.
/// With `encoder_side` 1 the log has θ, and the link is hidden: θ swings it on its spring, and all
/// joints feel that. All of the armature turns as logged; J_m does not count.
struct JointElasticity {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "joint_elasticity",
        .formula = "J_m (thdd - qdd), K (th - q) + D (thd - qd) = tau_s",
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
                        .sign = Sign::kNonNegative},
                       {.name = "friction_share",
                        .unit = "1",
                        .unit_prismatic = "1",
                        .sign = Sign::kNonNegative,
                        .linear = false,
                        .initial = 1.0,
                        .most = 1.0,
                        .choices = {1.0, 0.0}},
                       {.name = "encoder_side",
                        .unit = "1",
                        .unit_prismatic = "1",
                        .sign = Sign::kNonNegative,
                        .linear = false,
                        .most = 1.0,
                        .choices = {0.0, 1.0}}},
        .motor_side = true,
        .traits = {Trait::kOfDrive},
        .motor = HiddenMotor::kSpring,
        .shown_over = {ShownOver::kCorrelation, ShownOver::kAcceleration}};
    return kInfo;
  }

  template <class T>
  static MotorSpring<T> motor_spring(const T* p) {
    return {p[0], p[1], p[2], p[3]};
  }
  /// Tells whether the log's positions are the motor's. @param p  parameters
  static bool encoder_at_motor(const double* p) { return p[4] > 0.5; }
  static double transmitted(double deflection, double velocity, const double* p) {
    return gear_torque(deflection, velocity, p);
  }
  /// Torque of the spring [N·m] at θ − q [rad] and θ̇ − q̇ [rad/s].
  template <class T>
  static T gear_torque(const T& deflection, const T& velocity, const T* p) {
    return p[0] * deflection + p[1] * velocity;
  }
  /// θ − q [rad] that holds the load [N·m] at rest.
  template <class T>
  static T deflection_at(const T& load, const T* p) {
    return load / p[0];
  }

  /// θ − q (N) [rad] under the torque τ_s (N) [N·m].
  static VecX<double> deflection(const VecX<double>& load, double dt, const double* p) {
    return low_passed(load, dt, p[1] / p[0]) / p[0];
  }

  /// J_m(θ̈ − q̈) (N) [N·m].
  static VecX<double> rotor_torque(const VecX<double>& deflection, double dt, const double* p) {
    return p[2] * derivative(derivative(deflection, dt), dt);
  }
};

}  // namespace diffnea
