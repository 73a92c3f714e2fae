#pragma once
/// What a command refuses to write over before it begins, and how it ends.

#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/io/result_folder.hpp>

#include "common.hpp"

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

/// The result on standard output; below text, unless --quiet, the folder and what the run left in
/// it.
/// @param result  JSON with --json, else text
void show_result(const std::string& result, const ResultFolder& folder,
                 const CommonOptions& options);

/// Ends the command: why on standard error, and its exit status.
[[noreturn]] void stop(ExitStatus status, const std::string& why);

}  // namespace diffnea::apps
