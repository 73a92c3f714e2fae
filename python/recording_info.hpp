#pragma once
/// What columns cannot hold, as Python says it.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea::python {

/// @throws DataError listing the choices
RecordingInfo recording_info(const std::string& torque_side,
                             const std::optional<std::string>& torque_sampling);

/// Of a file: its sidecar's, and over that what is given. A side that is given brings its own
/// default sampling.
RecordingInfo described_info(const std::filesystem::path& data,
                             const std::optional<std::string>& torque_side,
                             const std::optional<std::string>& torque_sampling,
                             const std::vector<std::string>& passive, std::optional<double> period);

}  // namespace diffnea::python
