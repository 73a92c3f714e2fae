#pragma once
/// Recordings as commands take them: files of any format with their sidecars, and which joints of
/// them and of the model take part.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <diffnea/identify/joint_choice.hpp>
#include <diffnea/identify/source.hpp>

#include "foreign_files.hpp"
#include "progress.hpp"

namespace diffnea::apps {

/// Options that say what columns cannot; they override the sidecar.
struct RecordingOptions {
  std::vector<std::string> passive;
  std::string torque_side;  ///< "motor", "link"; empty: the sidecar's, else motor
  std::string map;          ///< columns by other names, as parse_column_map takes them
  JointChoice choice;
  BagOptions bag;
  bool quiet = false;
};

/// Adds --joints and --lock to a command.
void add_joint_options(CLI::App& command, JointChoice& choice);
/// Adds --map and the options of ROS bags to a command.
void add_file_options(CLI::App& command, RecordingOptions& options);
/// Adds all options of recordings to a command.
void add_recording_options(CLI::App& command, RecordingOptions& options);

/// A held-out error on data of the fit would be a lie, and a file taken twice would count twice.
/// @throws DataError naming the file
void refuse_repeated_files(const std::vector<std::string>& data,
                           const std::vector<std::string>& test);

/// Files that a command was given, as the library reads them: those of other formats as columns.
class RecordingFiles {
 public:
  /// @throws FileError, DataError as ForeignFiles, read_sidecar and parse_column_map
  RecordingFiles(const std::vector<std::string>& files, const RecordingOptions& options,
                 ProgressLine& line);

  const std::vector<std::filesystem::path>& paths() const { return paths_; }
  const std::vector<ReadOptions>& options() const { return options_; }
  /// @throws FileError, DataError as recordings_in_files
  std::unique_ptr<RecordingSource> open(const Model& model) const;

 private:
  ForeignFiles foreign_;
  std::vector<std::filesystem::path> paths_;
  std::vector<ReadOptions> options_;
};

/// Makes the model's moving joints those of the recordings, and says on standard error what that
/// took.
/// @return what was said; empty: nothing
/// @throws as serve_joints
std::string serve_joints_of(const RecordingFiles& data, const RecordingFiles& test,
                            const RecordingOptions& options, Model& model, ProgressLine& line);

}  // namespace diffnea::apps
