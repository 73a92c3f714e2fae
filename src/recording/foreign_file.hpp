#pragma once
/// Files that are no CSV, told by their ending. Internal.

#include <filesystem>
#include <string>

namespace diffnea::detail {

/// Refuses files of formats that `python -m diffnea.convert` reads, folders (ROS 2 bags are some),
/// and robot descriptions.
/// @param name  of the file, for the message
/// @throws FileError with the command that converts it, or with where a description is given
void refuse_foreign_file(const std::filesystem::path& path, const std::string& name);

}  // namespace diffnea::detail
