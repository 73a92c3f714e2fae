#pragma once
/// Files of a recording.

#include <filesystem>
#include <string>

#include "case.hpp"

namespace rigs {

/// @throws std::runtime_error if the file cannot be written
void write_text(const std::filesystem::path& path, const std::string& text);

/// stem.csv and stem.json, with the noise of the sensors.
/// @param torque_rms  per joint, that the noise is a share of [N·m]
void write_log(const std::filesystem::path& stem, const Case& c, const Recording& recording,
               const Eigen::VectorXd& torque_rms, bool is_test);

}  // namespace rigs
