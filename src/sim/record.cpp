#include <algorithm>

#include <diffnea/sim/record.hpp>

#include "sim/model_plant.hpp"

namespace diffnea {
namespace {

/// The effort limit of an arm's joint to which friction of about 1 N·m belongs.
constexpr double kArmEffort = 40.0;  // [N·m]

/// What the log, not the encoder, does to the motion: filtered velocities, a clock that is late.
void apply_channels(const Model& robot, Recording& r) {
  for (const BoundEffect& e : extend(robot, {0}).series)
    for (const int j : e.joints) {
      const double dt = r.rows() > 1 ? r.time[1] - r.time[0] : 0.0;
      if (std::holds_alternative<VelocityFilterLag>(e.type))
        r.qd.col(j) = low_passed(r.qd.col(j), dt, e.parameters[0]);
      if (!std::holds_alternative<TimeShift>(e.type) || r.rows() < 2) continue;
      r.q.col(j) = shifted(r.q.col(j), dt, -e.parameters[0]);
      if (r.qd.size() > 0) r.qd.col(j) = shifted(r.qd.col(j), dt, -e.parameters[0]);
    }
}

bool logs_velocity(const Model& robot) {
  return std::ranges::find(robot.effects, "velocity_filter_lag", &EffectSpec::effect) !=
         robot.effects.end();
}

}  // namespace

double torque_scale(const ModelLink& link) {
  return std::min(1.0, link.limits.effort / kArmEffort);
}

SimulatedRecording record_model(const Model& robot, const Model& controller,
                                const Trajectory& trajectory, const RecordOptions& options) {
  sim::ModelPlant plant(robot, options);
  SimulatedRecording out = sim::run_control_loop(plant, robot, controller, trajectory, options,
                                                 logs_velocity(robot));
  apply_channels(robot, out.recording);
  out.recording.source = robot.source;
  return out;
}

}  // namespace diffnea
