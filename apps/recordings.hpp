#pragma once
/// Recordings as commands take them: files with their sidecars.

#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <diffnea/identify/source.hpp>

#include "progress.hpp"

namespace diffnea::apps {

/// Options that say what columns cannot; they override the sidecar.
struct RecordingOptions {
  std::vector<std::string> passive;
  std::string torque_side;  ///< "motor", "link"; empty: the sidecar's, else motor
  bool quiet = false;
};

/// Adds --passive and --torque-side to a command.
void add_recording_options(CLI::App& command, RecordingOptions& options);

/// A held-out error on data of the fit would be a lie, and a file taken twice would count twice.
/// @throws DataError naming the file
void refuse_repeated_files(const std::vector<std::string>& data,
                           const std::vector<std::string>& test);

/// @throws FileError, DataError as recordings_in_files and read_sidecar
std::unique_ptr<RecordingSource> open_recordings(const Model& model,
                                                 const std::vector<std::string>& files,
                                                 const RecordingOptions& options,
                                                 ProgressLine& line);

}  // namespace diffnea::apps
