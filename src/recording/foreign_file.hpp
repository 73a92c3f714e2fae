#pragma once
/// Recordings that are no CSV: what Python reads and turns into CSV. Internal.

#include <filesystem>
#include <string>

namespace diffnea::detail {

/// Refuses files of formats that `python -m diffnea.convert` reads, told by their ending, and
/// folders (ROS 2 bags are some).
/// @param name  of the file, for the message
/// @throws FileError with the command that converts it
void refuse_foreign_file(const std::filesystem::path& path, const std::string& name);

}  // namespace diffnea::detail
