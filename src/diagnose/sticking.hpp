#pragma once
/// Where a joint sticks. Internal to diagnose/.
///
/// Friction then gives whatever holds the joint, between −F and F: nothing of the motion tells it,
/// and F tanh(q̇/v₀) of a filtered velocity less than anything. What that leaves at every reversal
/// passes for a spring, a delay or a ripple, on held-out data as well.

#include <vector>

#include <diffnea/core/scalar.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// Rows [first, last] that a position spends within a band, the longest there, where it turns back
/// or stands still. What turns back at a constant acceleration, whichever, is twice as long within
/// four times the band: rest = 1. A standstill in between does not get longer.
struct Turn {
  long first = 0, last = 0;
  double rest = 1.0;  ///< time within the band, of what four times the band adds to it
  long rows() const { return last - first + 1; }
};

/// What tells standstills from what noise and a filter leave of them.
struct Standstill {
  double band = 0.0;  ///< noise stays within it [rad] or [m]
  long rows = 1;      ///< a shorter standstill, the filter smooths as it does any reversal
  long lasting = 1;   ///< rows that no reversal takes
  long margin = 0;    ///< rows before and after it that the filter mixes with it
  long pause = 1;     ///< rows of a stretch of standing that is no part of a motion
};

/// @param q_noise  standard deviation of the logged position [rad] or [m]
/// @param qd, qdd  RMS of velocity and acceleration
/// @param plan     whose filter the velocities have passed; rows are dt apart
Standstill standstill(double q_noise, double qd, double qdd, const PreprocessPlan& plan);

/// Tells whether a joint stands still for as long as `q` was logged, but for shocks.
/// @param q      at least one position  @param noise  their standard deviation
bool stands_all_along(std::vector<double> q, double noise);

/// Turns of a logged position, of means over still.rows / 2 rows of it, in order.
std::vector<Turn> find_turns(const Eigen::Ref<const VecX<double>>& q, const Standstill& still);

/// Whether a joint sticks wherever it turns back, for too short a time to be told one by one.
bool sticks_at_turns(const std::vector<Turn>& turns);

/// Of `rows` rows, those that belong to a standstill, or to its margin: every turn if `everywhere`,
/// else those that rest, and those that last.
std::vector<bool> stands_still(const std::vector<Turn>& turns, const Standstill& still, long rows,
                               bool everywhere);

/// What becomes of the turns of a joint that sticks at each of them.
enum class Turns {
  kLeftOut,     ///< unless that takes more than half of the rows
  kAllLeftOut,  ///< whether or not it sticks there, and whatever that takes
  kKept,        ///< but for standstills
  kWholeStretches  ///< stretches of standing go alone: other friction, causes have to explain
};

/// Rows in which a joint sticks, of each stretch.
struct StuckRows {
  std::vector<std::vector<bool>> rows;
  bool everywhere = false;  ///< all turns are left out
};

/// @param positions  logged, of one joint, a stretch each
StuckRows stuck_rows(const std::vector<VecX<double>>& positions, const Standstill& still,
                     Turns what);

/// How often a joint turns back [1/s]; slower than `rest` it does not move.
double turn_rate(const std::vector<JointSeries>& series, int joint, double rest);

}  // namespace diffnea
