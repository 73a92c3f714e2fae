#include "recordings.hpp"

#include <cstdio>
#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/io/sidecar.hpp>

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

void add_recording_options(CLI::App& command, RecordingOptions& options) {
  command.add_option("--passive", options.passive, "joints whose torque is known to be zero");
  command
      .add_option("--torque-side", options.torque_side, "where torque is measured: motor or link")
      ->check(CLI::IsMember({"motor", "link"}));
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

std::unique_ptr<RecordingSource> open_recordings(const Model& model,
                                                 const std::vector<std::string>& files,
                                                 const RecordingOptions& options,
                                                 ProgressLine& line) {
  const std::vector<fs::path> paths(files.begin(), files.end());
  std::vector<RecordingInfo> info;
  info.reserve(files.size());
  for (const std::string& file : files) info.push_back(recording_info(file, options, line));
  return recordings_in_files(model, paths, info);
}

}  // namespace diffnea::apps
