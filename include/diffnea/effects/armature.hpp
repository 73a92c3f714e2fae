#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// armature: inertia of what turns with the motor, seen from the joint, J q̈.
/// make_tree reads an `armature` of the model as rotor inertia of the tree: use one of the two, not
/// both.
struct Armature {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "armature",
                                  .formula = "J qdd",
                                  .summary = "inertia of the rotor, reflected to the joint",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "armature",
                                                  .unit = "kg*m^2",
                                                  .unit_prismatic = "kg",
                                                  .sign = Sign::kNonNegative,
                                                  .native = NativeField::kArmature}},
                                  .motor_side = true,
                                  .traits = {Trait::kOfRobot, Trait::kRotor},
                                  .shown_over = {ShownOver::kAcceleration, ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    tau[*joint] += p[0] * x.qdd[*joint];
  }
};

}  // namespace diffnea
