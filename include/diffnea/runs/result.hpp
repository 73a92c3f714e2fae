#pragma once
/// RUN/result.json and RUN/series.json of a fit, both ways (docs/schema/identify.md).

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/identify/compare.hpp>
#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// A file that went into a run.
struct RunInput {
  std::string role;          ///< e.g. "model", "data", "test", "controller"
  std::string path;          ///< as it was given
  std::uintmax_t bytes = 0;  ///< size of the file
  std::string sha256;        ///< lower-case hexadecimal; empty for files above 64 MiB
};

/// What it takes to get the same result again.
struct Reproduce {
  std::string version;               ///< of diffnea
  std::vector<std::string> command;  ///< the arguments, the program's name first
  std::vector<RunInput> inputs;      ///< files that it read
};

/// A fit as RUN/ holds it.
struct FitRun {
  IdentifyResult fit;   ///< result of identify()
  Reproduce reproduce;  ///< the command that fitted it
};

/// Size and checksum of a file. @throws FileError if it cannot be read
RunInput describe_input(const std::string& role, const std::filesystem::path& path);

/// Schema "diffnea/identify/1". A number that does not exist (no test set, not identifiable) is
/// null.
std::string identify_result_json(const FitRun& run);

/// Schema "diffnea/series/1": measured, fitted and nominal torque of every joint over time, and the
/// ball's path, rounded to 6 digits.
/// @throws ModelError if a column of the path has another length than its time
std::string series_json(const IdentifyResult& fit);

/// Reads what the two functions above and write_model left in a folder. Without series.json the
/// series are empty; of model.json the posterior is read if it is there.
/// @throws FileError, ModelError naming file and key; for a result of another kind, naming its
/// schema
FitRun read_fit_run(const std::filesystem::path& folder);

/// Of what kind a run is: the schema that its result.json names, or another of its files.
/// @throws FileError, ModelError
std::string run_schema(const std::filesystem::path& folder, const char* name = "result.json");

/// Schema "diffnea/compare/1" (docs/schema/compare.md).
std::string comparison_json(const Comparison& comparison);

/// What `diffnea report --json` prints, schema "diffnea/report/1".
std::string report_result_json(const std::filesystem::path& page);

}  // namespace diffnea
