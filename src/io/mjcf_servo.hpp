#pragma once
/// Position servos as the `position` actuators of MuJoCo. Internal to io/.

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

#include "io/xml.hpp"

namespace diffnea::io {

/// bias + clip(kp (command − q) − kd q̇, ± force), the command of a delay ago
struct ServoActuator {
  std::string joint;
  double kp = 0.0;     ///< [N·m/rad] or [N/m]
  double kd = 0.0;     ///< [N·m·s/rad] or [N·s/m]
  double force = 0.0;  ///< [N·m] or [N]; infinite: no bound
  double bias = 0.0;   ///< [N·m] or [N]
  double delay = 0.0;  ///< [s]
};

/// Takes the position servos out of a model. What they brake adds to their joints' damping, which
/// acts beside the bound of the force, as the servo's does; a constant torque at the same joint
/// goes with the servo.
/// @param delays  actuators have them: those of MuJoCo 3.5
/// @param notes   gains what no actuator has: dead band, speed of the setpoint, other delays
std::vector<ServoActuator> take_servos(Model& model, bool delays, std::vector<std::string>& notes);

/// Adds those that the model's file had at other joints.
void add_file_servos(const Model& model, std::vector<ServoActuator>& servos);

/// Writes servos into a document's actuators: in the place of the first at that joint, else beside
/// the others.
void write_servos(XmlElement& root, const std::vector<ServoActuator>& servos);

}  // namespace diffnea::io
