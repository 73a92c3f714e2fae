#pragma once
/// Columns by other names, as `--map` gives them: in words, or in a JSON file.

#include <string>
#include <vector>

#include <diffnea/recording/csv.hpp>

namespace diffnea {

/// @param text  "gripper.pos=q_gripper [deg],action.0=qcmd_gripper [deg]", nothing behind a sign of
///              equality leaves a column out; or the path of a JSON file with an object that has
///              these names as keys and values
/// @throws DataError if it is neither; FileError if the file cannot be read
std::vector<ColumnName> parse_column_map(const std::string& text);

}  // namespace diffnea
