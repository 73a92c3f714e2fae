#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// stribeck_friction: what dry friction has more near standstill, F_s s e^{−(q̇/v_s)²}, over Coulomb
/// friction.
struct StribeckFriction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "stribeck_friction",
        .formula = "F_s tanh(qd/v0) exp(-(qd/v_s)^2)",
        .summary = "excess of dry friction near standstill, over coulomb_friction",
        .place = Place::kJoint,
        .parameters = {{.name = "stiction_excess",
                        .unit = "N*m",
                        .unit_prismatic = "N",
                        .sign = Sign::kNonNegative,
                        .native = NativeField::kStiction},
                       {.name = "stribeck_velocity",
                        .unit = "rad/s",
                        .unit_prismatic = "m/s",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 0.1,
                        .initial_prismatic = 0.01,
                        .search = log_grid(0.02, 1.0, 6),
                        .search_prismatic = log_grid(0.002, 0.1, 6),
                        .bound = SearchBound::kSmoothing,
                        .native = NativeField::kStribeckVelocity},
                       smoothing_parameter()},
        .motor_side = true,
        .reads = Reads::kSpeed,
        .shown_over = {ShownOver::kVelocity, ShownOver::kReversals}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T& qd = x.qd[*joint];
    using std::exp;
    const T ratio = qd / p[1];
    tau[*joint] += p[0] * smooth_sign(qd / p[2]) * exp(-ratio * ratio);
  }
};

}  // namespace diffnea
