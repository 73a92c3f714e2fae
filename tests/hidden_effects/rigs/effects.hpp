#pragma once
/// Effects to hide in a rig: every joint effect of the catalogue, and others outside of it.

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "plant.hpp"

namespace rigs {

using Json = nlohmann::ordered_json;

/// Usual course of a motion in which nothing is hidden, per joint.
struct Usual {
  Eigen::VectorXd torque, speed, push;       ///< root mean squares; torque of gravity and inertia
  Eigen::VectorXd high_torque, peak_torque;  ///< exceeded in a sixth of the time, never
  Eigen::VectorXd balance;                   ///< |mean| of the torque over its root mean square
  Eigen::VectorXd centre, spread;            ///< position: mean, root mean square about it
  Eigen::VectorXd inertia;                   ///< moved by a joint while the others are free
};

struct Effect {
  std::string name;         ///< name of the catalogue, or "outside/…"
  std::string where;        ///< joint, "a,b", "base", "tip" or "all"
  std::vector<int> joints;  ///< whose torques it shows in
  double strength = 0.0;    ///< its size grows with it
  double start = 0.0, limit = std::numeric_limits<double>::infinity();
  std::function<void(double strength, Rig&)> act;
  std::function<Json(double strength)> parameters;  ///< names of the catalogue, SI
  std::vector<std::string> variables;               ///< channels, outside the catalogue
  double velocity_lag = 0.0;                        ///< filter of a joint's logged velocity [s]
  int late_joint = -1;                              ///< whose velocity that is
};

struct Scene {
  const Arm& arm;
  const Usual& usual;
  double seconds;  ///< length of a run
  int runs;        ///< number of runs
  Draw& draw;
};

const std::vector<std::string>& catalogue();
const std::vector<std::string>& outside_effects();

/// @param name  of catalogue() or outside_effects()
Effect make_effect(const std::string& name, int joint, Scene& scene);
/// One wrong torque constant for all joints: the inertias take it up.
Effect common_gain(Scene& scene);

}  // namespace rigs
