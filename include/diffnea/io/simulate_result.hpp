#pragma once
/// What `diffnea simulate` and `diffnea excite` print with --json.

#include <string>
#include <vector>

#include <diffnea/recording/trajectory.hpp>
#include <diffnea/sim/record.hpp>

namespace diffnea {

/// Schema "diffnea/simulate/1". @param file  where the recording was written
std::string simulate_result_json(const SimulatedRecording& result, const std::string& file);
/// Schema "diffnea/excite/1". @param file  where the trajectory was written
/// @param notes  of fourier_notes()
std::string excite_result_json(const Trajectory& trajectory, double period, const std::string& file,
                               const std::vector<std::string>& notes);

}  // namespace diffnea
