#pragma once
/// Fits recordings to the joints of a model: order, passive joints, and whether positions can be
/// meant in radians. The model's joints come in as a plain struct (recording/ does not know the
/// model).

#include <limits>

#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// A joint as its model describes it. [rad, rad/s, N·m] or [m, m/s, N]; infinite: not given.
struct JointDescription {
  std::string name;                                           ///< as in the columns: q_<name>
  bool prismatic = false;                                     ///< slides; false: turns
  bool passive = false;                                       ///< its torque is known to be zero
  bool continuous = false;                                    ///< turns without end: no limits
  double lower = -std::numeric_limits<double>::infinity();    ///< least position
  double upper = std::numeric_limits<double>::infinity();     ///< largest position
  double velocity = std::numeric_limits<double>::infinity();  ///< largest |q̇|
  double effort = std::numeric_limits<double>::infinity();    ///< largest |τ|
};

/// Reorders the recordings' columns to `joints`, leaves those of other joints out, and takes over
/// which are passive: what torque they have counts as zero.
/// @throws DataError that lists both sets of names if a joint has no columns, or no joint is asked
/// for
void match_joints(const std::vector<JointDescription>& joints, std::vector<Recording>& recordings);

/// Something about a channel that looks wrong.
struct ChannelWarning {
  std::string joint;  ///< whose channel it is
  std::string text;   ///< column, numbers and what they suggest, one sentence
};
/// Revolute joints whose positions leave their limits (without limits: ±2π by far) and fit them as
/// degrees. The columns must be in the order of `joints`.
std::vector<ChannelWarning> find_degrees(const std::vector<JointDescription>& joints,
                                         const std::vector<Recording>& recordings);

/// Makes gaps of torques that cannot be true: short bursts far beyond the rest of their column and
/// the effort limits, which a file's reader would have left out (docs/recordings.md). The columns
/// must be in the order of `joints`.
/// @return one sentence per recording and joint concerned
std::vector<std::string> blank_absurd_torque(const std::vector<JointDescription>& joints,
                                             std::vector<Recording>& recordings);

/// Torques that are counts of a signed number read as unsigned: −9 shows as 65527.
std::vector<ChannelWarning> find_twos_complement_torque(const std::vector<JointDescription>& joints,
                                                        const std::vector<Recording>& recordings);

/// Joints whose measured torque goes beyond twice their effort limit: a unit, a current, or a
/// torque behind another gear. The columns must be in the order of `joints`.
std::vector<ChannelWarning> find_excess_torque(const std::vector<JointDescription>& joints,
                                               const std::vector<Recording>& recordings);

}  // namespace diffnea
