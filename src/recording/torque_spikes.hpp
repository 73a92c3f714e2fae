#pragma once
/// Torques that are finite and yet cannot be true: short bursts, far beyond all other values of
/// their column. Internal.
///
/// No threshold on its own can tell: a drive that rests most of the time has a small median, and
/// effort limits of models are often wrong. So a value must be far beyond what 98 % of the column
/// stay below (a file with more than 1 % of impossible rows is refused anyway, so that these are
/// true), and its neighbours must not be.

#include <filesystem>
#include <string>
#include <vector>

#include "recording/columns.hpp"

namespace diffnea::detail {

/// A longer stretch beyond the limit is no burst but the torque's own course [rows].
constexpr std::size_t kLongestBurst = 20;

/// From where a torque is suspect [N·m] or [N]; infinite: never.
struct SuspectTorque {
  double above = std::numeric_limits<double>::infinity();
  std::string than;  ///< "more than 1000 times …", for messages
};

/// @param sizes   |τ| of rows spread over the recording; overwritten
/// @param effort  the joint's limit; infinite or 0: not given
SuspectTorque suspect_torque(std::vector<double>& sizes, double effort);

/// The same for every column of a file, those that are no torque included (never suspect). Looks at
/// stretches of the file, 1 MB in all.
std::vector<SuspectTorque> suspect_torques(const std::filesystem::path& path, const Columns& header,
                                           const std::vector<JointDescription>& joints);

}  // namespace diffnea::detail
