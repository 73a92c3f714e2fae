#pragma once
/// Fits recordings to the joints of a model: order, passive joints, and whether positions can be
/// meant in radians. The model's joints come in as a plain struct (recording/ does not know the
/// model).

#include <limits>
#include <string>
#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// A joint that follows another: q = ratio · q_leader + offset. It is no joint of a recording,
/// which may have columns of it all the same.
struct FollowerDescription {
  std::string name;     ///< as the model has it
  double ratio = 1.0;   ///< [rad/rad, m/rad …]
  double offset = 0.0;  ///< [rad, m]
};

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
  std::vector<FollowerDescription> followers = {};            ///< joints that follow it
};

/// Something about a channel that looks wrong.
struct ChannelWarning {
  std::string joint;  ///< whose channel it is
  std::string text;   ///< column, numbers and what they suggest, one sentence
};

/// Takes the columns of joints that follow others out of a recording: their torques, times their
/// ratios, are added to those of the joints they follow.
/// @param deviations  added to, if given: followers whose positions are not those of the relation,
///                    by more than the noise of the deviation
void merge_followers(const std::vector<JointDescription>& joints, Recording& recording,
                     std::vector<ChannelWarning>* deviations = nullptr);

/// Reorders the recordings' columns to `joints`, merges those of joints that follow others
/// (merge_followers), leaves those of other joints out, and takes over which are passive: what
/// torque they have counts as zero.
/// @throws DataError that lists both sets of names if a joint has no columns, or no joint is asked
/// for
void match_joints(const std::vector<JointDescription>& joints, std::vector<Recording>& recordings,
                  std::vector<ChannelWarning>* deviations = nullptr);

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
