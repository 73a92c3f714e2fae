#pragma once
/// Stretches of recordings in which all torques are known, and the windows that they are cut into:
/// each is simulated in one go from a first state of its own.

#include <memory>
#include <string>
#include <vector>

#include <diffnea/effects/command.hpp>
#include <diffnea/motion/sensor_noise.hpp>

namespace diffnea {

/// Consecutive rows between which a simulation can go on. Rows may lie at any times. m rows, n
/// joints.
struct MotionStretch {
  int run = 0;               ///< number of its recording
  std::vector<double> time;  ///< (m) [s]
  RowMatX<double> q;         ///< (m, n) positions; NaN: not measured, or the sensor's old value
  RowMatX<double> u;         ///< (m, n) torque that acts from row k to k+1
  RowMatX<double> u_end;     ///< (m, n) torque at the end of that step (u if held)
  /// Torques push at links, as loads do, not at drives: that differs where a gear is between them.
  bool at_links = false;
  /// Commands of the run's drives, where these have loops of their own; else null.
  std::shared_ptr<const CommandPath> command;

  /// Time from the first row to the last [s].
  double length() const { return time.back() - time.front(); }
};

/// Rows of one stretch that are simulated in one go.
struct MotionWindow {
  std::size_t stretch = 0;  ///< index among the stretches
  long first = 0;           ///< first row in the stretch
  long rows = 0;            ///< number of rows
  VecX<double> state;       ///< (2n) q, q̇ at the first row: estimate
};

/// Commands of a recording's drives; off where no position is commanded, or the column
/// `torque_enable` (of one joint: with `_<joint>`) is not above 0. Gains are those of its sidecar,
/// the supply is that of supply_of().
/// @throws DataError for a gain that is not above 0
CommandPath command_path(const Recording& recording);

/// Supply of each joint's drive [V], (N, n): the column `voltage` (of one joint: with `_<joint>`),
/// in V or `[mV]`. NaN: not logged there; empty: in no row.
RowMatX<double> supply_of(const Recording& recording);

/// Median supply of a joint's drive over all rows [V]; 0: it was never logged.
double median_supply(const std::vector<Recording>& recordings, int joint);

/// Stretches of one recording. Where torque drives, a pause of more than five periods and a row
/// without a torque end a stretch; a robot that nothing drives goes on through both.
/// @param noise    of the sensors: what was not refreshed does not count
/// @param passive    (n) joints whose torque is 0 where none is given
/// @param commanded  (n) joints that the model's own drives lead; what is logged of their torque is
///                   not used
std::vector<MotionStretch> motion_stretches(const Recording& recording, const SensorNoise& noise,
                                            const std::vector<bool>& passive,
                                            const std::vector<bool>& commanded = {});

/// Windows of that length, the last one of a stretch as long as is left. First states are those of
/// `measured_state` over `first_horizon`.
/// @param horizon  [s]
std::vector<MotionWindow> cut_windows(const std::vector<MotionStretch>& stretches, double horizon);
/// The same of windows: their pieces.
std::vector<MotionWindow> cut_windows(const std::vector<MotionStretch>& stretches, double horizon,
                                      const std::vector<MotionWindow>& windows);

/// Local motion of a stretch: a cubic in time through the positions (of lower degree where rows are
/// few).
struct LocalMotion {
  VecX<double> q;    ///< (n) [rad] or [m]
  VecX<double> qd;   ///< (n) [rad/s] or [m/s]
  VecX<double> qdd;  ///< (n) [rad/s²] or [m/s²]
};
/// @param at    time [s] to which the motion belongs
/// @param from  first of the rows that count
/// @param rows  number of these, at least one
LocalMotion local_motion(const MotionStretch& stretch, double at, long from, long rows);

/// Least and largest position of each joint, (n) [rad] or [m]; +∞ and −∞ where none was measured.
struct PositionRange {
  VecX<double> low;   ///< least
  VecX<double> high;  ///< largest
};
/// Range of all rows of the stretches. @param joints  number of them
PositionRange position_range(const std::vector<MotionStretch>& stretches, long joints);

/// Root mean square of the positions about their mean in each stretch, (n) [rad] or [m]: error of a
/// simulation that knows no more than where the joint is.
VecX<double> motion_size(const std::vector<MotionStretch>& stretches);

}  // namespace diffnea
