#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

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
        .motor_side = true,
        .traits = {Trait::kFriction, Trait::kIfAsked, Trait::kNoAmplitude},
        .shown_over = {ShownOver::kVelocity, ShownOver::kReversals}};
    return kInfo;
  }

  template <Scalar T>
  static StateRate<T> derivative(const T& z, const T& qd, const T* p) {
    const T size = select(qd < T(0.0), T(-qd), qd), side = select(qd < T(0.0), T(-1.0), T(1.0));
    const T ratio = qd / p[4], square = ratio * ratio;
    const T bounded = select(square > T(700.0), T(700.0), square);  // beyond, e^{−x} is no number
    const T g = p[2] + (p[3] - p[2]) * exp_of(T(-bounded));
    return {T(1.0) - p[0] / g * side * z, T(0.0), p[0] * size / g};
  }
  /// σ₀z + σ₁ż [N·m] at the bend z [rad].
  template <Scalar T>
  static T torque(const T& z, const T& zd, const T* p) {
    return p[0] * z + p[1] * zd;
  }
  template <Scalar T>
  static AtRest<T> at_rest(const T* p) {
    return {p[0], p[1]};
  }
  /// Exact, and stable for any stiffness.
  static double advance(double z, const Move& move, const double* p) {
    const double a = derivative(z, move.velocity, p).forgetting, h = move.time;
    // (1 − e^{−ah})/a, which is h where a vanishes.
    const double reach = a * h > 1e-12 ? -std::expm1(-a * h) / a : h;
    return z * std::exp(-a * h) + move.velocity * reach;
  }
};

}  // namespace diffnea
