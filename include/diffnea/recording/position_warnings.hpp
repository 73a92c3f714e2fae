#pragma once
/// Positions that no model explains: turns that wrap, lengths in another unit.

#include <vector>

#include <diffnea/recording/joints.hpp>

namespace diffnea {

/// Revolute joints whose position jumps by a whole turn from one row to the next and stays there:
/// an encoder that begins again at ±π. (A turn and back is a spike.) The columns must be in the
/// order of `joints`.
std::vector<ChannelWarning> find_wrapped(const std::vector<JointDescription>& joints,
                                         const std::vector<Recording>& recordings);

/// Slides whose positions leave their limits by half of their range, and fit them as millimetres or
/// centimetres. Slides without limits are not looked at. Columns as above.
std::vector<ChannelWarning> find_other_lengths(const std::vector<JointDescription>& joints,
                                               const std::vector<Recording>& recordings);

}  // namespace diffnea
