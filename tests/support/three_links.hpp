#pragma once
/// The arm of three links that most tests of a diagnosis record.

#include "support/mujoco_arm.hpp"

namespace diffnea::test {

/// The first axis is vertical: what it carries turns about it like a rotor.
inline constexpr const char* kArm = R"(<mujoco model="arm">
  <compiler angle="radian" inertiafromgeom="false"/>
  <worldbody>
    <body name="column" pos="0 0 0.4">
      <inertial pos="0.01 0.02 0.1" mass="6" diaginertia="0.08 0.07 0.05"/>
      <joint name="yaw" axis="0 0 1" limited="true" range="-2 2"/>
      <body name="upper" pos="0 0 0.2">
        <inertial pos="0.2 0.01 0" mass="3" diaginertia="0.01 0.05 0.05"/>
        <joint name="shoulder" axis="0 1 0" limited="true" range="-1.5 1.5"/>
        <body name="fore" pos="0.4 0 0">
          <inertial pos="0.15 0 0.01" mass="2" diaginertia="0.005 0.02 0.02"/>
          <joint name="elbow" axis="0 1 0" limited="true" range="-2 2"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
)";

inline const MujocoArm& arm() {
  static const MujocoArm kOne(kArm);
  return kOne;
}

/// In its elbow.
inline const EffectSpec kCoulomb{"coulomb_friction", "elbow", {{"coulomb", 0.4, ""}}};

}  // namespace diffnea::test
