#pragma once
/// What `diffnea simulate` and `diffnea excite` print with --json.

#include <string>

#include <diffnea/excite/design.hpp>
#include <diffnea/sim/record.hpp>

namespace diffnea {

/// Schema "diffnea/simulate/1".
/// @param runs  of one robot, the last of which may have failed  @param file  where they are
/// written
std::string simulate_result_json(const std::vector<SimulatedRecording>& runs,
                                 const std::string& file);
/// Schema "diffnea/excite/1". @param file  where the trajectory was written
std::string excite_result_json(const Excitation& result, const std::string& file);

}  // namespace diffnea
