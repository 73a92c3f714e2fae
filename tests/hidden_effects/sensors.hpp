#pragma once
/// What a logger makes of a simulated motion: noise, quantisation, delays of channels; and the
/// files.

#include <filesystem>

#include "case.hpp"

namespace hidden {

/// Noise on the positions, drawn before the simulation because the controller sees it too.
Eigen::MatrixXd draw_position_noise(const Case& c, Rng& rng);

/// Writes the recording <stem>.csv, and <stem>.json with what columns cannot hold.
/// @param torque_rms  of the training recording: the sensors are the same in both [N·m]
void write_recording(const std::filesystem::path& stem, const Case& c, const Series& series,
                     const Eigen::MatrixXd& position_noise, const Eigen::VectorXd& torque_rms,
                     Rng& rng);

/// @throws std::runtime_error if the file cannot be written
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace hidden
