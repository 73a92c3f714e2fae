#pragma once
/// Trajectory files: CSV with `time`, and per joint `qcmd_<joint>`, `qdcmd_<joint>`,
/// `qddcmd_<joint>`, in s, rad (m), rad/s, rad/s².

#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/recording/trajectory.hpp>

namespace diffnea {

/// Names of joints that a header cannot hold. Call it before the work. @throws DataError
void check_trajectory_names(const std::vector<std::string>& joint_names);

/// Numbers are written so that they come back bit by bit. @throws FileError, DataError
void write_trajectory(const Trajectory& trajectory, const std::filesystem::path& path);

/// Velocities and accelerations that the file does not have are central differences of what it has.
/// Columns of other names are ignored: a recording with qcmd_* is a trajectory too.
/// @throws FileError, DataError `file:line: …`
Trajectory read_trajectory(const std::filesystem::path& path);

}  // namespace diffnea
