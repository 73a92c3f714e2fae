#pragma once
/// Trajectory files: CSV with `time`, and per joint `qcmd_<joint>`, `qdcmd_<joint>`,
/// `qddcmd_<joint>`, in s, rad (m), rad/s, rad/s².

#include <filesystem>

#include <diffnea/recording/trajectory.hpp>

namespace diffnea {

/// Numbers are written so that they come back bit by bit. @throws FileError
void write_trajectory(const Trajectory& trajectory, const std::filesystem::path& path);

/// Velocities and accelerations that the file does not have are central differences of what it has.
/// Columns of other names are ignored: a recording with qcmd_* is a trajectory too.
/// @throws FileError, DataError `file:line: …`
Trajectory read_trajectory(const std::filesystem::path& path);

}  // namespace diffnea
