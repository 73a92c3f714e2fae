#pragma once
/// Serial machines of drawn geometry and inertias, their files, and their regressor.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "draw.hpp"

namespace rigs {

/// Joint and the link that it moves. All frames are parallel at position 0.
struct Joint {
  std::string name;
  bool slide = false, passive = false;
  Eigen::Vector3d axis, offset;  ///< offset: from the parent joint's frame [m]
  /// Pseudo-inertia about the joint's frame, (∫ x xᵀ dm, ∫ x dm; ·, m): positive definite for every
  /// possible body, and only for those.
  Eigen::Matrix4d pseudo;
  double coulomb = 0.0, viscous = 0.0, rotor = 0.0;  ///< declared by the model
};

struct Arm {
  std::string kind;  ///< "arm", "gantry" or "pendulum"
  std::vector<Joint> joints;
  Eigen::Vector3d tip;                          ///< in the last link's frame [m]
  Eigen::Vector3d gravity = {0.0, 0.0, -9.81};  ///< in the base's frame [m/s²]
  int size() const { return static_cast<int>(joints.size()); }
  bool first_is_upright() const;  ///< joint 1 turns about the direction of gravity
};

/// @param kind  "arm", "gantry" (two slides) or "pendulum" (the second joint has no drive)
/// @param num_joints  of an arm, 2 to 7
Arm draw_arm(const std::string& kind, int num_joints, bool level, Draw& draw);

/// The same machine as its data sheet has it: masses, centres, inertias, friction and rotors off by
/// `low` to `high`; every link stays a possible body.
Arm misjudged(const Arm& arm, double low, double high, Draw& draw);

/// Document for MuJoCo; with what the joints declare, motors and a site `tip` if `as_nominal`.
std::string to_mjcf(const Arm& arm, bool as_nominal);
/// Nominal model as URDF; it holds no rotors. A base that is not level hangs at a fixed joint.
std::string to_urdf(const Arm& arm);

/// Torques as linear in m, h, Ixx, Ixy, Ixz, Iyy, Iyz, Izz of each link about its joint's frame:
/// (n, 10 n), by Newton and Euler outward in the base's frame.
Eigen::MatrixXd regressor(const Arm& arm, const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                          const Eigen::VectorXd& qdd);
/// Inertial numbers of all links, (10 n).
Eigen::VectorXd inertial_parameters(const Arm& arm);

}  // namespace rigs
