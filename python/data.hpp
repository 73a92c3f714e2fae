#pragma once
/// What identification and diagnosis take their rows from.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/joint_choice.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/runs/result_folder.hpp>

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

/// Overrides of what the sidecars of files say, and which joints take part.
struct FileOptions {
  std::optional<std::string> torque_side;
  std::vector<std::string> passive;
  JointChoice choice = {};
};

inline std::vector<ReadOptions> read_options(const Data& data, const FileOptions& options) {
  std::vector<ReadOptions> out;
  for (const std::filesystem::path& file : data.files) {
    out.emplace_back();
    out.back().info =
        described_info(file, options.torque_side, std::nullopt, options.passive, std::nullopt);
  }
  return out;
}

/// The model whose joints are those of all data.
inline ServedModel serve(const Model& model, const Data& train, const Data& test,
                         const FileOptions& options) {
  if (train.files.empty() && test.files.empty()) {
    std::vector<Recording> all = train.recordings;
    all.insert(all.end(), test.recordings.begin(), test.recordings.end());
    return serve_joints(model, all, options.choice);
  }
  if (train.files.empty()) return serve_joints(model, train.recordings, options.choice);
  std::vector<std::filesystem::path> files = train.files;
  std::vector<ReadOptions> read = read_options(train, options);
  for (ReadOptions& one : read_options(test, options)) read.push_back(std::move(one));
  files.insert(files.end(), test.files.begin(), test.files.end());
  return serve_joints(model, files, read, options.choice);
}

inline std::unique_ptr<RecordingSource> open(const Model& model, const Data& data,
                                             const FileOptions& options) {
  if (data.files.empty()) return recordings_in_memory(model, data.recordings);
  return recordings_in_files(model, data.files, read_options(data, options));
}

/// The file that holds the model, as an input of a run: its source, or model.json beside it where
/// that is a run's. None where it holds another model: this one was changed in memory since.
inline std::vector<RunInput> describe_model(const Model& model) {
  const std::filesystem::path source = model.source;
  if (source.empty()) return {};
  for (const std::filesystem::path& file : {source, source.parent_path() / "model.json"}) {
    std::error_code unreadable;
    if (!std::filesystem::is_regular_file(file, unreadable)) continue;
    try {
      if (model_to_json(read_model(file)) == model_to_json(model))
        return {describe_input("model", file)};
    } catch (const Error&) {  // no longer a model
    }
  }
  return {};
}

inline std::vector<RunInput> describe_inputs(const Model& model, const Data& train,
                                             const Data& test) {
  std::vector<RunInput> out = describe_model(model);
  for (const std::filesystem::path& file : train.files) out.push_back(describe_input("data", file));
  for (const std::filesystem::path& file : test.files) out.push_back(describe_input("test", file));
  return out;
}

/// work(model, train, test) on the opened recordings (test is null without any), under supervision;
/// the model is the one whose joints are logged.
/// @param inputs  set to the files, as they were before the work
/// @return what work returned, with a note of what was locked among its notes
template <typename Work>
auto on_recordings(const Model& model, const Data& train, const Data& test,
                   const FileOptions& options, Supervisor& supervisor,
                   std::vector<RunInput>& inputs, Work work) {
  return supervisor.run([&] {
    const ServedModel served = serve(model, train, test, options);
    const std::unique_ptr<RecordingSource> train_source = open(served.model, train, options);
    std::unique_ptr<RecordingSource> test_source;
    if (!test.empty()) test_source = open(served.model, test, options);
    inputs = describe_inputs(model, train, test);
    auto out = work(served.model, *train_source, test_source.get());
    if (!served.note.empty()) out.notes.insert(out.notes.begin(), served.note);
    return out;
  });
}

}  // namespace diffnea::python
