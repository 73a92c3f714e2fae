#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// actuator_lag: the drive's torque u follows the command τ_c late, T u̇ = τ_c − u, and τ_c is
/// logged, which is u + T u̇: adds T u̇. In the model u is the whole torque that it predicts
/// (JointSeries::drive).
struct ActuatorLag {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "actuator_lag",
                                  .formula = "T du/dt = tau_c - u",
                                  .summary = "torque that follows its command as a first-order lag",
                                  .port = Port::kMemory,
                                  .parameters = {{.name = "time_constant",
                                                  .unit = "s",
                                                  .unit_prismatic = "s",
                                                  .sign = Sign::kNonNegative}},
                                  .motor_side = true,
                                  .traits = {Trait::kOfDrive},
                                  .shown_over = {ShownOver::kTorqueRate, ShownOver::kCorrelation}};
    return kInfo;
  }

  template <class T>
  static void add_to_drive(const T* p, DrivePath<T>& path) {
    path.lag += p[0];
  }

  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    return p[0] * derivative(x.drive().col(joint), x.dt);
  }
};

}  // namespace diffnea
