#pragma once
/// A desired motion of all joints of a robot, from that of the joints with a motor.

#include <diffnea/recording/trajectory.hpp>

#include "dynamics/loop_motion.hpp"

namespace diffnea::sim {

/// Rows of all joints, (N, n) [rad, rad/s, rad/s²] or [m …].
struct DesiredMotion {
  VecX<double> time;  ///< (N) since the first row of the trajectory [s]
  RowMatX<double> q, qd, qdd;
};

/// Every row of the trajectory, or of a long one as many as tell what it takes. Passive joints that
/// it lacks rest at 0; in a loop they follow, and their own columns say where the loop begins.
/// @param joints  of the robot  @param loop  its loops; null: it has none
/// @throws DataError naming the time, where a loop does not close or is at a dead point, or where
///         the desired positions of more drives than motions contradict each other
DesiredMotion desired_motion(const Trajectory& trajectory, const std::vector<std::string>& joints,
                             const LoopMotion* loop);

}  // namespace diffnea::sim
