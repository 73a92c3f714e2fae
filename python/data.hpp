#pragma once
/// What identification and diagnosis take their rows from.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/identify/source.hpp>
#include <diffnea/io/result.hpp>
#include <diffnea/io/result_folder.hpp>

#include "recording_info.hpp"
#include "supervisor.hpp"

namespace diffnea::python {

namespace py = pybind11;

/// Files, which are streamed, or recordings in memory.
struct Data {
  std::vector<std::filesystem::path> files;
  std::vector<Recording> recordings;

  explicit Data(const py::list& items) {
    for (const py::handle item : items)
      if (py::isinstance<Recording>(item))
        recordings.push_back(py::cast<Recording>(item));
      else
        files.push_back(py::cast<std::filesystem::path>(item));
  }
  bool empty() const { return files.empty() && recordings.empty(); }
};

/// Of files, over what their sidecars say.
struct FileOptions {
  std::optional<std::string> torque_side;
  std::vector<std::string> passive;
};

inline std::unique_ptr<RecordingSource> open(const Model& model, const Data& data,
                                             const FileOptions& options) {
  if (data.files.empty()) return recordings_in_memory(model, data.recordings);
  std::vector<RecordingInfo> info;
  for (const std::filesystem::path& file : data.files)
    info.push_back(
        described_info(file, options.torque_side, std::nullopt, options.passive, std::nullopt));
  return recordings_in_files(model, data.files, info);
}

inline std::vector<RunInput> describe_inputs(const Model& model, const Data& train,
                                             const Data& test) {
  std::vector<RunInput> out;
  if (std::filesystem::exists(model.source)) out.push_back(describe_input("model", model.source));
  for (const std::filesystem::path& file : train.files) out.push_back(describe_input("data", file));
  for (const std::filesystem::path& file : test.files) out.push_back(describe_input("test", file));
  return out;
}

/// work(train, test) on the opened recordings (test is null without any), with the GIL free. What
/// Python raised during progress comes through.
template <typename Work>
auto on_recordings(const Model& model, const Data& train, const Data& test,
                   const FileOptions& options, Supervisor& supervisor, Work work) {
  std::optional<decltype(work(std::declval<const RecordingSource&>(), nullptr))> out;
  try {
    const py::gil_scoped_release release;
    const std::unique_ptr<RecordingSource> train_source = open(model, train, options);
    std::unique_ptr<RecordingSource> test_source;
    if (!test.empty()) test_source = open(model, test, options);
    out = work(*train_source, test_source.get());
  } catch (const Error&) {
    supervisor.rethrow();  // stopped before there was anything to return
    throw;
  }
  supervisor.rethrow();
  return std::move(*out);
}

}  // namespace diffnea::python
