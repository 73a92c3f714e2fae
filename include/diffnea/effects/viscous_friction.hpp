#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// viscous_friction: friction in proportion to speed, b q̇.
struct ViscousFriction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "viscous_friction",
                                  .formula = "b qd",
                                  .summary = "friction in proportion to speed",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "viscous",
                                                  .unit = "N*m*s/rad",
                                                  .unit_prismatic = "N*s/m",
                                                  .sign = Sign::kNonNegative,
                                                  .native = NativeField::kDamping}},
                                  .motor_side = true,
                                  .reads = Reads::kSpeedLinearly,
                                  .shown_over = {ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    tau[*joint] += p[0] * x.qd[*joint];
  }
};

}  // namespace diffnea
