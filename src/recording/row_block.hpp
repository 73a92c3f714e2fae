#pragma once
/// Rows of a recording's file as its series. Internal.

#include <span>

#include <diffnea/recording/recording.hpp>

#include "recording/columns.hpp"

namespace diffnea::detail {

/// The measured series alone: `source`, `run` and `info` are the caller's to fill in.
/// @param values  (rows × columns) in SI, row-major
Recording recording_of_rows(std::span<const double> values, const Columns& header);

}  // namespace diffnea::detail
