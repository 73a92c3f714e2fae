#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// actuator_delay: the command acts d later, u(t) = τ_c(t − d), and τ_c is logged: adds u(t + d) −
/// u(t). In the model u is the whole torque that it predicts (JointSeries::drive).
struct ActuatorDelay {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "actuator_delay",
                                  .formula = "u(t) = tau_c(t - d)",
                                  .summary = "torque that acts some time after its command",
                                  .port = Port::kMemory,
                                  .parameters = {{.name = "delay",
                                                  .unit = "s",
                                                  .unit_prismatic = "s",
                                                  .sign = Sign::kNonNegative,
                                                  .linear = false,
                                                  .search = log_grid(1e-3, 50e-3, 6)}},
                                  .motor_side = true,
                                  .traits = {Trait::kOfDrive, Trait::kShared},
                                  .shown_over = {ShownOver::kTorqueRate, ShownOver::kCorrelation}};
    return kInfo;
  }

  template <class T>
  static void add_to_drive(const T* p, DrivePath<T>& path) {
    path.delay += p[0];
  }

  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    const VecX<double> u = x.drive().col(joint);
    return shifted(u, x.dt, p[0]) - u;
  }
};

}  // namespace diffnea
