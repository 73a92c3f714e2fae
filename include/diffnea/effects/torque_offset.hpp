#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// torque_offset: a constant in the measured torque, τ + c.
struct TorqueOffset {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "torque_offset",
        .formula = "c",
        .summary = "constant offset of the torque",
        .place = Place::kJoint,
        .parameters = {{.name = "offset", .unit = "N*m", .unit_prismatic = "N"}},
        .motor_side = false,
        .traits = {Trait::kOfDrive, Trait::kAtMotor},
        .reads = Reads::kNothing,
        .shown_over = {ShownOver::kTime}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>&, const int* joint, const T* p, T* tau) const {
    tau[*joint] += p[0];
  }
};

}  // namespace diffnea
