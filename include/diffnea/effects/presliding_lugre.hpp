#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// presliding_lugre: bristles that bend, ż = q̇ − σ₀|q̇| z/g(q̇), torque σ₀z + σ₁ż, with Stribeck's
/// curve g = F_c + (F_s − F_c) e^{−(q̇/v_s)²} (Canudas de Wit et al. 1995, eq. 1–4; their viscous
/// term is viscous_friction). In steady motion it is g(q̇) sgn(q̇). It begins unloaded, z = 0.
struct PreslidingLugre {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "presliding_lugre",
        .formula =
            "s0 z + s1 dz/dt, dz/dt = qd - s0 |qd| z/g(qd), g = F_c + (F_s - F_c) exp(-(qd/v_s)^2)",
        .summary =
            "dry friction that begins as a damped spring, with Stribeck's curve: LuGre's model",
        .port = Port::kMemory,
        .parameters = {{.name = "stiffness",
                        .unit = "N*m/rad",
                        .unit_prismatic = "N/m",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 100.0,
                        .initial_prismatic = 1000.0,
                        .search = log_grid(10.0, 1e4, 4),
                        .search_prismatic = log_grid(100.0, 1e5, 4)},
                       {.name = "damping",
                        .unit = "N*m*s/rad",
                        .unit_prismatic = "N*s/m",
                        .sign = Sign::kNonNegative,
                        .linear = false},
                       {.name = "coulomb",
                        .unit = "N*m",
                        .unit_prismatic = "N",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 1.0},
                       {.name = "stiction",
                        .unit = "N*m",
                        .unit_prismatic = "N",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 1.0},
                       {.name = "stribeck_velocity",
                        .unit = "rad/s",
                        .unit_prismatic = "m/s",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 0.1,
                        .initial_prismatic = 0.01,
                        .search = {0.05, 0.3},
                        .search_prismatic = {0.005, 0.03}}},
        .motor_side = true};
    return kInfo;
  }

  /// σ₀|q̇|/g(q̇) [1/s]: how fast the bristles forget.
  static double rate(double qd, const double* p) {
    const double ratio = qd / p[4];
    return p[0] * std::abs(qd) / (p[2] + (p[3] - p[2]) * std::exp(-ratio * ratio));
  }

  /// z [rad] after `h` seconds at constant velocity: exact, and stable for any stiffness.
  static double advance(double z, double qd, double h, const double* p) {
    const double a = rate(qd, p);
    // (1 − e^{−ah})/a, which is h where a vanishes.
    const double reach = a * h > 1e-12 ? -std::expm1(-a * h) / a : h;
    return z * std::exp(-a * h) + qd * reach;
  }

  /// σ₀z + σ₁ż [N·m] at the bend z [rad] and q̇ [rad/s].
  static double torque(double z, double qd, const double* p) {
    return p[0] * z + p[1] * (qd - rate(qd, p) * z);
  }

  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    constexpr int kSubsteps = 8;  // velocity straight between the rows, constant within a substep
    const double h = x.dt / kSubsteps;
    VecX<double> out(x.rows());
    double z = 0.0;
    for (long k = 0; k < x.rows(); ++k) {
      for (int i = 0; k > 0 && i < kSubsteps; ++i) {
        const double share = (i + 0.5) / kSubsteps;
        z = advance(z, (1 - share) * x.qd(k - 1, joint) + share * x.qd(k, joint), h, p);
      }
      out[k] = torque(z, x.qd(k, joint), p);
    }
    return out;
  }
};

}  // namespace diffnea
