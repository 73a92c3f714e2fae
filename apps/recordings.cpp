#include "recordings.hpp"

#include <cstdio>
#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/io/column_map.hpp>
#include <diffnea/io/sidecar.hpp>
#include <diffnea/recording/foreign_file.hpp>

#include "common.hpp"

namespace diffnea::apps {
namespace {

namespace fs = std::filesystem;

RecordingInfo recording_info(const std::string& path, const RecordingOptions& given,
                             ProgressLine& line) {
  ReadOptions options;
  options.info.passive = given.passive;
  const std::optional<Sidecar> sidecar = read_sidecar(path);
  if (sidecar && !given.quiet) {
    line.clear();
    for (const std::string& note : sidecar->notes)
      std::fprintf(stderr, "%s: %s\n", sidecar->path.string().c_str(), note.c_str());
  }
  RecordingInfo info = with_sidecar(path, options).info;
  if (!given.torque_side.empty()) {
    const TorqueSide side = given.torque_side == "link" ? TorqueSide::kLink : TorqueSide::kMotor;
    if (side != info.torque_side)  // the default sampling of that side (contract)
      info.torque_sampling =
          side == TorqueSide::kLink ? TorqueSampling::kInstant : TorqueSampling::kHold;
    info.torque_side = side;
  }
  return info;
}

}  // namespace

void add_joint_options(CLI::App& command, JointChoice& choice) {
  command
      .add_option("--joints", choice.joints,
                  "these joints alone move; the others of the model are locked, other columns left "
                  "out; default: those that are logged; separated by commas")
      ->delimiter(',');
  command
      .add_option("--lock", choice.lock,
                  "JOINT or JOINT=VALUE [rad, m]: does not move; without a value at the median of "
                  "its column, else at the model's home, else at 0 within its limits; separated by "
                  "commas")
      ->delimiter(',');
}

void add_file_options(CLI::App& command, RecordingOptions& options) {
  command.add_option("--map", options.map,
                     "columns by other names: \"COLUMN=q_JOINT [deg],OTHER=\" (nothing: left out), "
                     "or a JSON file; a law of raw counts as unit: [0.0879*deg-180]");
  command.add_option("--topic", options.bag.topic, "of a ROS bag: joint states");
  command.add_option("--command-topic", options.bag.command_topic,
                     "of a ROS bag: commands (JointState, JointTrajectory)");
  command.add_option("--clock", options.bag.clock, "of a ROS bag: header (default) or receive")
      ->check(CLI::IsMember({"header", "receive"}));
}

void add_recording_options(CLI::App& command, RecordingOptions& options) {
  command.add_option("--passive", options.passive, "joints whose torque is known to be zero");
  command
      .add_option("--torque-side", options.torque_side, "where torque is measured: motor or link")
      ->check(CLI::IsMember({"motor", "link"}));
  add_joint_options(command, options.choice);
  add_file_options(command, options);
}

void refuse_repeated_files(const std::vector<std::string>& data,
                           const std::vector<std::string>& test) {
  std::vector<std::string> all = data;
  all.insert(all.end(), test.begin(), test.end());
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      std::error_code ignored;
      if (!fs::equivalent(all[i], all[k], ignored)) continue;
      throw DataError(all[i] + (i >= data.size() && k < data.size()
                                    ? ": is given as data of the fit and as --test; held-out data "
                                      "must be other recordings"
                                    : ": is given twice"));
    }
}

RecordingFiles::RecordingFiles(const std::vector<std::string>& files,
                               const RecordingOptions& options, ProgressLine& line) {
  const std::vector<ColumnName> columns = parse_column_map(options.map);
  for (const std::string& file : files) {
    ReadOptions one;
    one.name = file;
    one.columns = columns;
    one.info = recording_info(file, options, line);
    fs::path path = file;
    if (const std::string kind = foreign_kind(file); !kind.empty()) {
      line.show("reading " + kind, "");
      ColumnsOfFile read = foreign_.read(file, kind, options.bag);
      path = std::move(read.path);
      one.notes = std::move(read.notes);
    }
    paths_.push_back(std::move(path));
    options_.push_back(std::move(one));
  }
}

std::unique_ptr<RecordingSource> RecordingFiles::open(const Model& model) const {
  return recordings_in_files(model, paths_, options_);
}

std::string serve_joints_of(const RecordingFiles& data, const RecordingFiles& test,
                            const RecordingOptions& options, Model& model, ProgressLine& line) {
  std::vector<fs::path> paths = data.paths();
  std::vector<ReadOptions> read = data.options();
  paths.insert(paths.end(), test.paths().begin(), test.paths().end());
  read.insert(read.end(), test.options().begin(), test.options().end());
  ServedModel served = serve_joints(model, paths, read, options.choice);
  model = std::move(served.model);
  if (!served.note.empty()) {
    line.clear();
    std::fprintf(stderr, "%s\n", served.note.c_str());
  }
  return served.note;
}

}  // namespace diffnea::apps
