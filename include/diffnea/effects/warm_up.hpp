#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// warm_up: cold grease, b e^{−t/T} q̇: viscous friction that a run begins with and loses as it
/// warms, t since the run began.
struct WarmUp {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "warm_up",
        .formula = "b exp(-t/T) qd",
        .summary = "viscous friction that fades while the joint warms up",
        .place = Place::kJoint,
        .parameters = {{.name = "viscous",
                        .unit = "N*m*s/rad",
                        .unit_prismatic = "N*s/m",
                        .sign = Sign::kNonNegative},
                       {.name = "time_constant",
                        .unit = "s",
                        .unit_prismatic = "s",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 60.0,
                        .search = log_grid(3.0, 1000.0, 6)}},
        .motor_side = true,
        .traits = {Trait::kReadsTime},
        .shown_over = {ShownOver::kTimeAlongMotion, ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    using std::exp;
    tau[*joint] += p[0] * exp(T(-x.time) / p[1]) * x.qd[*joint];
  }
};

}  // namespace diffnea
