#pragma once
/// What `diffnea simulate` and `diffnea excite` print with --json.

#include <string>

#include <diffnea/excite/design.hpp>
#include <diffnea/sim/record.hpp>

namespace diffnea {

/// Schema "diffnea/simulate/1". @param file  where the recording was written
std::string simulate_result_json(const SimulatedRecording& result, const std::string& file);
/// Schema "diffnea/excite/1". @param file  where the trajectory was written
std::string excite_result_json(const Excitation& result, const std::string& file);

}  // namespace diffnea
