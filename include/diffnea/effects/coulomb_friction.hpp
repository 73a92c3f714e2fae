#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// coulomb_friction: dry friction of constant size, F_c s with s = tanh(q̇/v₀).
struct CoulombFriction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "coulomb_friction",
                                  .formula = "F_c tanh(qd/v0)",
                                  .summary = "dry friction of constant size",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "coulomb",
                                                  .unit = "N*m",
                                                  .unit_prismatic = "N",
                                                  .sign = Sign::kNonNegative,
                                                  .native = NativeField::kFrictionLoss},
                                                 smoothing_parameter()},
                                  .motor_side = true,
                                  .reads = Reads::kSpeed,
                                  .shown_over = {ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    tau[*joint] += p[0] * smooth_sign(x.qd[*joint] / p[1]);
  }
};

}  // namespace diffnea
