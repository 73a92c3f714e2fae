#pragma once
/// backlash: a gap β in the gear, K·deadzone(θ − q, β/2) = τ, the torque the links transmit: θ − q
/// = τ/K + (β/2) sgn τ. The rotor crosses the gap where the *transmitted torque* changes its sign,
/// and the log has J_m(θ̈ − q̈) more than the base model, whose armature turns with q. sgn τ is
/// tanh(τ/τ_w): τ_w, the torque at which the faces of the teeth are in contact, makes the crossing
/// as smooth as filtered motion is.

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

struct Backlash {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "backlash",
        .formula = "J_m (thdd - qdd), th - q = tau/K + beta/2 tanh(tau/tau_w)",
        .summary = "gap between the teeth of a gear; the motor's angle is hidden",
        .port = Port::kMemory,
        .parameters = {{.name = "gap",
                        .unit = "rad",
                        .unit_prismatic = "m",
                        .sign = Sign::kNonNegative,
                        .linear = false,
                        .initial = 0.01,
                        .initial_prismatic = 1e-4},
                       {.name = "stiffness",
                        .unit = "N*m/rad",
                        .unit_prismatic = "N/m",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 1e4,
                        .initial_prismatic = 1e6},
                       {.name = "motor_inertia",
                        .unit = "kg*m^2",
                        .unit_prismatic = "kg",
                        .sign = Sign::kNonNegative},
                       {.name = "contact_torque",
                        .unit = "N*m",
                        .unit_prismatic = "N",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 0.5,
                        .search = log_grid(0.1, 3.0, 4)}},
        .motor_side = true};
    return kInfo;
  }

  /// θ − q [rad] at the torque τ [N·m].
  static double deflection_at(double tau, const double* p) {
    return tau / p[1] + 0.5 * p[0] * std::tanh(tau / p[3]);
  }

  /// τ [N·m] at θ − q [rad]: the root of deflection_at, which rises throughout, by Newton's method
  /// kept in its bracket.
  static double transmitted(double deflection, const double* p) {
    double low = p[1] * (std::abs(deflection) - 0.5 * p[0]), high = p[1] * std::abs(deflection);
    low = low > 0.0 ? low : 0.0;
    double tau = low;
    for (int i = 0; i < 100; ++i) {
      const double off = deflection_at(tau, p) - std::abs(deflection);
      (off > 0.0 ? high : low) = tau;
      const double s = std::tanh(tau / p[3]);
      double next = tau - off / (1.0 / p[1] + 0.5 * p[0] * (1.0 - s * s) / p[3]);
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      const double change = std::abs(next - tau);
      tau = next;
      if (!(change > 1e-13 * (1.0 + tau))) break;
    }
    return deflection < 0.0 ? -tau : tau;
  }

  /// θ − q (N) [rad].
  VecX<double> deflection(const JointSeries& x, int joint, const double* p) const {
    const VecX<double> tau = x.tau.col(joint);
    return tau.unaryExpr([p](double torque) { return deflection_at(torque, p); });
  }

  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    return p[2] * derivative(derivative(deflection(x, joint, p), x.dt), x.dt);
  }
};

}  // namespace diffnea
