#pragma once
/// What a command refuses to write over, before it begins.

#include <filesystem>
#include <string>
#include <vector>

namespace diffnea::apps {

/// Refuses an output that is one of the inputs.
/// @throws FileError
void refuse_overwriting(const std::string& output, const std::vector<std::string>& inputs);

/// Refuses a folder whose model.urdf, say, is an input that no run left there: its results would
/// overwrite it. @throws FileError naming the file
void refuse_own_inputs(const std::filesystem::path& folder, const std::vector<std::string>& inputs);

/// Refuses a folder whose result is another command's. @param schema  how that of ours begins
/// @throws FileError
void refuse_other_runs(const std::filesystem::path& folder, const std::string& schema);

}  // namespace diffnea::apps
