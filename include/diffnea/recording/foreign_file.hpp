#pragma once
/// Recordings that are no CSV, told by their ending or what lies in the folder. The package of
/// Python reads them; the command hands them over to it (docs/recordings.md).

#include <filesystem>
#include <string>

namespace diffnea {

/// "a ROS 2 bag", "a Parquet file", "a LeRobot data set", "a log of BAM", …; empty: to be read as
/// CSV. A file that is not there has the kind of its name.
std::string foreign_kind(const std::filesystem::path& path);

/// Refuses such files, and robot descriptions.
/// @param name  of the file, for the message
/// @throws FileError with the command that converts it, or with where a description is given
void refuse_foreign_file(const std::filesystem::path& path, const std::string& name);

}  // namespace diffnea
