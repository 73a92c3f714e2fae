#pragma once
/// What a command refuses to write over before it begins, and how it ends.

#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/runs/result_folder.hpp>

#include "common.hpp"

namespace diffnea::apps {

/// Refuses a file, before the work, that is one of the inputs or cannot be written. Empty: none.
/// @throws FileError
void check_output(const std::string& output, const std::vector<std::string>& inputs);

/// The same for several, of which no two may be the same file.
void check_outputs(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs);

/// The result on standard output; below text, unless --quiet, the folder and what the run left in
/// it.
/// @param result  JSON with --json, else text
void show_result(const std::string& result, const ResultFolder& folder,
                 const CommonOptions& options);

/// Ends the command: why on standard error, and its exit status.
[[noreturn]] void stop(ExitStatus status, const std::string& why);

}  // namespace diffnea::apps
