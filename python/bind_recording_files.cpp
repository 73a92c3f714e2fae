/// Recordings from files and back, and what columns cannot hold.

#include <filesystem>
#include <optional>
#include <utility>
#include <variant>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/io/column_map.hpp>
#include <diffnea/io/sidecar.hpp>
#include <diffnea/recording/csv.hpp>

#include "bindings.hpp"
#include "recording_info.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;
namespace fs = std::filesystem;

using Names = std::vector<std::pair<std::string, std::string>>;

/// Reads one file; what is not given comes from the sidecar of `described_by`.
/// @param name  what to call the data, where the file is not the user's own
/// @param notes  of whoever made the file; they come first in the report
py::tuple read_file(const fs::path& path, const std::string& name, const fs::path& described_by,
                    const std::optional<std::string>& torque_side,
                    const std::optional<std::string>& torque_sampling,
                    const std::vector<std::string>& passive, std::optional<double> period,
                    const std::variant<std::string, Names>& columns,
                    const std::vector<std::string>& notes) {
  ReadReport report;
  std::vector<Recording> runs;
  {
    const py::gil_scoped_release release;
    ReadOptions options;
    options.info = described_info(described_by, torque_side, torque_sampling, passive, period);
    options.name = name;
    options.notes = notes;
    if (const std::string* text = std::get_if<std::string>(&columns))
      options.columns = parse_column_map(*text);
    else
      for (const auto& [from, to] : std::get<Names>(columns)) options.columns.push_back({from, to});
    runs = read_recordings(path, options, &report);
  }
  return py::make_tuple(runs, report);
}

/// Before anything is written: whether what columns cannot hold finds its place beside them.
void check_sidecar(const std::vector<Recording>& recordings, const fs::path& path) {
  for (std::size_t k = 1; k < recordings.size(); ++k)
    if (const std::string key = sidecar_difference(recordings[0].info, recordings[k].info);
        !key.empty())
      throw DataError("write_recording: recordings 0 and " + std::to_string(k) + " differ in '" +
                      key + "', which " + path.filename().string() +
                      " can hold only once for all its runs; write them into files of their own");
  sidecar_path(path);
}

void write_files(std::vector<Recording> recordings, const fs::path& path) {
  const py::gil_scoped_release release;
  check_sidecar(recordings, path);
  if (recordings.size() > 1)  // their numbers may come from several files
    for (std::size_t k = 0; k < recordings.size(); ++k) recordings[k].run = static_cast<int>(k);
  write_recordings(recordings, path);
  write_sidecar(recordings.front().info, path);
}

void write_sidecar_of(const Recording& recording, const fs::path& path) {
  write_sidecar(recording.info, path);
}

}  // namespace

RecordingInfo recording_info(const std::string& torque_side,
                             const std::optional<std::string>& torque_sampling) {
  RecordingInfo info;
  if (torque_side != "motor" && torque_side != "link")
    throw DataError("torque_side: got '" + torque_side + "'; choices: motor, link");
  info.torque_side = torque_side == "link" ? TorqueSide::kLink : TorqueSide::kMotor;
  const std::string sampling =
      torque_sampling.value_or(info.torque_side == TorqueSide::kLink ? "instant" : "hold");
  if (sampling != "hold" && sampling != "instant")
    throw DataError("torque_sampling: got '" + sampling + "'; choices: hold, instant");
  info.torque_sampling = sampling == "hold" ? TorqueSampling::kHold : TorqueSampling::kInstant;
  return info;
}

RecordingInfo described_info(const fs::path& data, const std::optional<std::string>& torque_side,
                             const std::optional<std::string>& torque_sampling,
                             const std::vector<std::string>& passive,
                             std::optional<double> period) {
  ReadOptions options;
  options.info.passive = passive;
  RecordingInfo info = with_sidecar(data, options).info;
  if (torque_side) {
    const RecordingInfo asked = recording_info(*torque_side, torque_sampling);
    if (asked.torque_side != info.torque_side || torque_sampling)
      info.torque_sampling = asked.torque_sampling;
    info.torque_side = asked.torque_side;
  } else if (torque_sampling) {
    info.torque_sampling = recording_info("motor", torque_sampling).torque_sampling;
  }
  if (period) info.period = *period;
  return info;
}

void bind_recording_files(py::module_& m) {
  value_type<QuarantinedRow>(m);
  value_type<ReadReport>(m);
  m.def("_read_recordings", &read_file, "path"_a, "name"_a, "described_by"_a, "torque_side"_a,
        "torque_sampling"_a, "passive"_a, "period"_a, "columns"_a, "notes"_a);
  m.def("_write_recordings", &write_files, "recordings"_a, "path"_a);
  m.def("_check_sidecar", &check_sidecar, "recordings"_a, "path"_a);
  m.def("_write_sidecar", &write_sidecar_of, "recording"_a, "path"_a);
}

}  // namespace diffnea::python
