#pragma once
/// Why rows of recordings cannot be used together: too few, or columns that have no row in common.
/// Internal.

#include <string>
#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea::detail {

/// Columns of positions and torques that begin late or end early, and lose a quarter and more of
/// what is lost so: "'tau_elbow' ends at 3.2 s"; empty if none does.
std::string uneven_columns(const std::vector<Recording>& recordings);

/// Why no `least` rows that follow each other have a position and a torque of every joint, for a
/// message: one row, a column without a value, columns that share no row.
std::string why_no_rows(const std::vector<Recording>& recordings, int least);

}  // namespace diffnea::detail
