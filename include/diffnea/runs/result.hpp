#pragma once
/// RUN/result.json and RUN/series.json of a fit, both ways (docs/schema/identify.md).

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/identify/compare.hpp>
#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// A file that went into a run.
struct RunInput {
  std::string role;
  std::string path;
  std::uintmax_t bytes = 0;
  std::string sha256;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("RunInput", "A file that went into a run.");
    list.field("role", &RunInput::role, "E.g. ``model``, ``data``, ``test``, ``controller``.");
    list.field("path", &RunInput::path, "As it was given.");
    list.field("bytes", &RunInput::bytes, "Size of the file.");
    list.field("sha256", &RunInput::sha256, "Lower-case hexadecimal; empty for files above 64 MiB.",
               {.empty_is_null = true});
  }
};

/// What it takes to get the same result again.
struct Reproduce {
  std::string version;
  std::vector<std::string> command;
  std::vector<RunInput> inputs;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Reproduce", "What it takes to get the same result again.");
    list.field("version", &Reproduce::version, "Of diffnea.", {.optional = true});
    list.field("command", &Reproduce::command, "The arguments, the program's name first.");
    list.field("inputs", &Reproduce::inputs, "Files that it read.");
  }
};

/// A fit as RUN/ holds it.
struct FitRun {
  IdentifyResult fit;  ///< result of identify()
  Reproduce reproduce;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("IdentifyResult", "A fit: the model with uncertainties, and how well it predicts.",
              {.files = kInResult});
    list.embed(&FitRun::fit);
    list.field("reproduce", &FitRun::reproduce, "Version, command and input files.",
               {.optional = true});
  }
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
