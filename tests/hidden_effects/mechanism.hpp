#pragma once
/// A mechanism is what makes a simulated robot differ from its rigid-body model: hooks into MuJoCo,
/// into the drive and into the sensors, and one strength that is scaled until the effect has the
/// size that was drawn. The formulas are written here for the second time on purpose: nothing of
/// diffnea/effects is used.

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <mujoco/mujoco.h>
#include <nlohmann/json.hpp>

#include "robot.hpp"

namespace hidden {

using Json = nlohmann::ordered_json;

/// The robot at one instant of the integration.
struct State {
  const mjModel* model;
  mjData* data;
  double time;                      ///< since the recording began [s]
  std::vector<int> dof, motor_dof;  ///< per joint; the same unless the joint has a rotor
  Eigen::VectorXd q, qd;            ///< of the links
  Eigen::VectorXd motor_q, motor_qd;
  Eigen::VectorXd applied;  ///< torque of the motors [N·m]
};

/// What a joint's encoder makes of its position: scale · q + offset.
struct Encoder {
  double scale = 1.0, offset = 0.0;
};

struct Mechanism {
  std::string effect;       ///< name of the catalogue, or "outside/…"
  std::string where;        ///< a joint, "a,b", "base", "tip" or "all"
  std::vector<int> joints;  ///< whose torques it shows in

  double strength = 0.0;                                   ///< the size of the effect grows with it
  double start = 0.0;                                      ///< a strength to try first
  double limit = std::numeric_limits<double>::infinity();  ///< of what is plausible or stable

  // Hooks; those that are empty do nothing. s is the strength.
  std::function<void(double s, const Robot&, Additions&)> add_parts;
  std::function<void(double s, mjModel&, const State&)> configure;
  std::function<void()> reset;
  /// Completes qpos and qvel of added parts at the start of the motion.
  std::function<void(const State&)> place;
  /// Torque of the motor under a command, mean over the next dt seconds.
  std::function<double(double s, int joint, double command, double dt)> drive;
  /// Adds generalised forces to qfrc (in MuJoCo's order and sign).
  std::function<void(double s, const State&, double* qfrc)> force;
  /// Moves states of its own on by dt.
  std::function<void(double s, const State&, double dt)> advance;
  std::function<Encoder(double s, int joint)> encoder;
  std::function<double(double s)> position_delay;  ///< of all logged positions [s]
  /// Time constant of the logged velocities' filter [s].
  std::function<double(double s, int joint)> velocity_lag;

  /// Parameters by the catalogue's names, SI.
  std::function<Json(double s)> parameters;
  /// Variables that the effect depends on, by channel, for those outside the catalogue.
  std::vector<std::string> variables;
};

}  // namespace hidden
