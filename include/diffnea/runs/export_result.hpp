#pragma once
/// What `diffnea export` prints with --json.

#include <filesystem>
#include <string>
#include <vector>

namespace diffnea {

/// Schema "diffnea/export/1" (docs/schema/export.md).
/// @param from  the model or run that was exported  @param to  the file that was written
/// @param left_out  what its format cannot hold, as write_model returns it
std::string export_result_json(const std::filesystem::path& from, const std::filesystem::path& to,
                               const std::vector<std::string>& left_out);

}  // namespace diffnea
