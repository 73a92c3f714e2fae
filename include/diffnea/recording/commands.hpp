#pragma once
/// Commands as the input of a drive: what must hold before a drive is fitted to them.

#include <vector>

#include <diffnea/recording/joints.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// Tells whether a series (N, n) of joints, which may be empty, has a value of this one.
bool is_logged(const RowMatX<double>& series, long joint);

/// Tells whether a column is that of all drives, by its name alone, or with a joint's name of this
/// one's.
bool is_of_drive(const std::string& column, const std::string& name, const std::string& joint);

/// Desired positions (N, n), or (N, 0); NaN where the drive is off: none is commanded, or the
/// column `torque_enable` (of one joint: with `_<joint>`) is not above 0.
RowMatX<double> live_commands(const Recording& recording);

/// Joints whose position comes before its command, by more than a row and five standard errors: the
/// columns are exchanged, or the command is stamped too late.
/// @param joints  in the order of the columns
std::vector<ChannelWarning> find_early_responses(const std::vector<JointDescription>& joints,
                                                 const std::vector<Recording>& recordings);

/// Refuses recordings of which nothing can be said of a drive: rows too far apart to see it,
/// degrees where radians are expected, positions that come before their commands.
/// @throws DataError naming the recording, the joint and what to do
void require_commands(const std::vector<JointDescription>& joints,
                      const std::vector<Recording>& recordings);

/// Says that no joint of the recordings has a torque, and lists the columns that there are: one
/// sentence. Empty: some joint has one, or all are passive.
std::string why_no_torque(const std::vector<Recording>& recordings);

/// Refuses recordings without any torque, for work that explains torques: says first what would be
/// wrong with them for drives, too (require_commands), then why_no_torque.
/// @throws DataError as require_commands; naming the recording and its columns
void require_torque(const std::vector<JointDescription>& joints,
                    const std::vector<Recording>& recordings);

}  // namespace diffnea
