#include <algorithm>

#include <diffnea/sim/record.hpp>

#include "sim/model_plant.hpp"

namespace diffnea {
namespace {

/// The effort limit of an arm's joint to which friction of about 1 N·m belongs.
constexpr double kArmEffort = 40.0;  // [N·m]

}  // namespace

void RecordOptions::scale_noise(double factor) {
  for (double* noise :
       {&position_noise, &slide_noise, &torque_noise, &camera_noise, &place_noise, &turn_noise})
    *noise *= factor;
}

double torque_scale(const ModelLink& link) {
  return std::min(1.0, link.limits.effort / kArmEffort);
}

SimulatedRecording record_model(const Model& robot, const Model& controller,
                                const Trajectory& trajectory, const RecordOptions& options) {
  if (robot.free_base)
    throw ModelError("simulate: the base '" + robot.links[0].name + "' of '" + robot.name +
                     "' floats, and flights are simulated by MuJoCo: give its MJCF, --world "
                     "mujoco:FILE.xml (world=); --fix-base (fix_base=True) holds it where the file "
                     "has it");
  sim::ModelPlant plant(robot, options);
  SimulatedRecording out = sim::run_control_loop(plant, robot, controller, trajectory, options);
  out.recording.source = robot.source;
  return out;
}

}  // namespace diffnea
