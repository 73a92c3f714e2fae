#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// torque_gain: wrong torque constant, (1 + ε) τ: adds ε times the transmitted torque of the
/// sample. Friction is not in that torque; a gain on it too only rescales the friction's own
/// parameters.
struct TorqueGain {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "torque_gain",
        .formula = "eps tau",
        .summary = "relative error of the torque constant",
        .place = Place::kJoint,
        .parameters = {{.name = "gain_error", .unit = "1", .unit_prismatic = "1"}},
        .motor_side = false,
        .traits = {Trait::kReadsAcceleration, Trait::kOfDrive, Trait::kAtMotor, Trait::kOfRobot,
                   Trait::kGain, Trait::kShared},
        .shown_over = {ShownOver::kTorque}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    tau[*joint] += p[0] * x.tau[*joint];
  }
};

}  // namespace diffnea
