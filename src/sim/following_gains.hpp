#pragma once
/// Gains with which a robot follows a given motion.

#include <diffnea/recording/trajectory.hpp>
#include <diffnea/sim/controller.hpp>

namespace diffnea::sim {

/// The gains that options ask for, raised at joints that would miss their motion: with gains of
/// inertia alone a light joint is held by its friction, or swung by the others. Law kPd, and
/// kComputedTorque of a robot with loops.
/// @param robot       the robot as it is: its friction counts
/// @param controller  the model that compensates gravity
/// @param q0          (n) where the robot starts
JointGains following_gains(const Model& robot, const Model& controller,
                           const Trajectory& trajectory, const ControllerOptions& options,
                           const VecX<double>& q0);

}  // namespace diffnea::sim
