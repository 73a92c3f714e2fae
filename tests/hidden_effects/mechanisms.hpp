#pragma once
/// Every kind of hidden effect, by family; shapes (widths, frequencies, ratios) are drawn, the
/// strength is left to be scaled.

#include "mechanism.hpp"
#include "random.hpp"

namespace hidden {

/// Root mean squares of the motion without hidden effects, from which shapes and first strengths
/// are drawn.
struct Scales {
  Eigen::VectorXd torque, velocity, acceleration;  ///< per joint
  Eigen::VectorXd position;                        ///< deviation from its mean
  Eigen::VectorXd centre;                          ///< mean position
  Eigen::VectorXd inertia;                         ///< rms of torque without gravity / acceleration
};

struct Draw {
  const Robot& robot;
  const Scales& scales;
  Rng& rng;

  const Link& link(int j) const { return robot.links[static_cast<std::size_t>(j)]; }
  const std::string& joint(int j) const { return link(j).joint; }
  double torque(int j) const { return scales.torque[j]; }
  double speed(int j) const { return scales.velocity[j]; }
};

/// friction.cpp: coulomb_friction, viscous_friction, quadratic_friction, stribeck_friction,
/// asymmetric_coulomb, asymmetric_viscous, sublinear_friction, load_friction, presliding_dahl,
/// presliding_lugre, warm_up
Mechanism friction(const std::string& effect, int joint, const Draw& draw);
bool is_friction(const std::string& effect);

/// joint.cpp: armature, joint_spring, cogging
Mechanism joint_effect(const std::string& effect, int joint, const Draw& draw);
bool is_joint_effect(const std::string& effect);

/// drive.cpp: torque_gain, torque_offset, actuator_lag, actuator_delay, saturation
Mechanism drive_effect(const std::string& effect, int joint, const Draw& draw);
bool is_drive_effect(const std::string& effect);
/// One torque constant that is wrong for all joints.
Mechanism common_torque_gain(const Draw& draw);

/// transmission.cpp: joint_elasticity, backlash; cable_differential_friction and
/// transmission_coupling between joint and joint + 1
Mechanism transmission(const std::string& effect, int joint, const Draw& draw);
bool is_transmission(const std::string& effect);

/// surroundings.cpp: base_tilt, tip_force, payload
Mechanism surroundings(const std::string& effect, const Draw& draw);
bool is_surroundings(const std::string& effect);

/// channel.cpp: encoder_offset, encoder_scale, time_shift, velocity_filter_lag
Mechanism channel(const std::string& effect, int joint, const Draw& draw);
bool is_channel(const std::string& effect);

/// outside.cpp: detent, product_friction, time_ripple, position_friction, wall, neighbour_cable
Mechanism outside(const std::string& kind, int joint, const Draw& draw);
const std::vector<std::string>& outside_kinds();

/// Any of the catalogue.
Mechanism mechanism(const std::string& effect, int joint, const Draw& draw);

}  // namespace hidden
