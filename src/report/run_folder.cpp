#include <algorithm>
#include <string_view>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/asset_paths.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/report/diagnose_page.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/learn_page.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/report/transfer_page.hpp>
#include <diffnea/runs/policy_file.hpp>

namespace diffnea {
namespace {

namespace fs = std::filesystem;

/// model.json, and the form that the model came in. @param notes  gains what that form cannot hold
void write_models(const Model& model, const ResultFolder& folder, std::vector<std::string>& notes) {
  const fs::path& staging = folder.staging();
  write_model(model, staging / "model.json");
  std::string name = "the model in the form that it came in";
  try {
    const std::string extension = document_extension(model);
    if (extension.empty()) return;
    name = "model" + extension;
    std::string left_out;
    const fs::path document = staging / name;
    for (const std::string& what : write_model(model, document))
      left_out += (left_out.empty() ? "" : ", ") + what;
    write_file_atomically(document,
                          with_moved_paths(read_text_file(document), name, staging, folder.path()));
    if (!left_out.empty())
      notes.push_back(name + " cannot hold: " + left_out + "; model.json does");
  } catch (const ModelError& error) {  // the file changed since it was read; the fit is not lost
    notes.push_back(name + " was not written: " + error.what());
  }
}

/// Whether a file is called `stem`, a seed, `ending`.
bool is_of_seed(const std::string& name, std::string_view stem, std::string_view ending) {
  return name.size() > stem.size() + ending.size() && name.starts_with(stem) &&
         name.ends_with(ending) &&
         std::all_of(name.begin() + static_cast<long>(stem.size()),
                     name.end() - static_cast<long>(ending.size()),
                     [](char c) { return c >= '0' && c <= '9'; });
}

/// Whether a run left its result, or another file, in the folder: what it has beside it is of that
/// run.
bool holds(const fs::path& folder, std::string_view schema, const char* name = "result.json") {
  try {
    return run_schema(folder, name).starts_with(schema);
  } catch (const Error&) {
    return false;
  }
}

/// kRunFiles, and the policies and recordings that are in the folder, or will be. In a folder that
/// no run left they are not ours: recording_1.csv may well be what was fitted to.
std::vector<std::string> run_files(const ResultFolder& folder) {
  std::vector<std::string> out = kRunFiles;
  const bool transferred = holds(folder.path(), "diffnea/transfer/"),
             learned = transferred || holds(folder.path(), "diffnea/learn/");
  for (const bool staged : {false, true}) {
    const fs::path& place = staged ? folder.staging() : folder.path();
    std::error_code error;
    for (fs::directory_iterator it(place, error), end; !error && it != end; it.increment(error)) {
      const std::string name = it->path().filename().string();
      const bool is_policy = is_of_seed(name, "policy_", ".json"),
                 is_recording = is_of_seed(name, "recording_", ".csv") ||
                                is_of_seed(name, "recording_", ".json"),
                 is_ours = (is_policy && (staged || learned)) ||
                           (is_recording && (staged || transferred));
      if (is_ours && std::ranges::find(out, name) == out.end()) out.push_back(name);
    }
  }
  return out;
}

void write_task(const BallInCup& task, const std::vector<LearnedPolicy>& policies,
                const fs::path& folder) {
  write_model(task.model, folder / "model.json");
  write_model(task.controller, folder / "controller.json");
  if (const auto& network = task.options.simulator.ball_network)
    write_file_atomically(folder / kBallNetworkFile, network->text);
  for (const LearnedPolicy& p : policies) write_policy(p, folder / policy_file_name(p.seed));
}

[[noreturn]] void refuse_foreign(const fs::path& file) {
  throw FileError(file.string() +
                  ": was not left by diffnea, whose result would replace it; choose another "
                  "folder");
}

}  // namespace

void check_run_folder(const fs::path& folder, const std::string& command) {
  std::error_code ignored;
  if (!fs::exists(folder / "result.json", ignored)) {
    if (holds(folder, "diffnea/", "series.json")) return;  // a killed run's, which comes first
    for (const std::string& name : kRunFiles)
      if (fs::exists(folder / name, ignored)) refuse_foreign(folder / name);
    return;
  }
  std::string there;
  try {
    there = run_schema(folder);
  } catch (const Error&) {
    refuse_foreign(folder / "result.json");
  }
  if (!there.starts_with("diffnea/" + command + "/"))
    throw FileError(folder.string() + ": holds another command's result (" + there +
                    "), which would be lost; choose another folder");
}

void publish_fit_run(FitRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_models(run.fit.model, folder, run.fit.notes);
  write_file_atomically(staging / "series.json", series_json(run.fit));
  write_file_atomically(staging / "result.json", identify_result_json(run));
  // From what was written, so that `diffnea report` gives the same page.
  write_file_atomically(staging / "report.html", identify_page(read_fit_run(staging)));
  folder.publish(kRunFiles);
}

void publish_diagnose_run(DiagnoseRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_models(run.finding.model, folder, run.finding.notes);
  if (run.finding.next_experiment && run.finding.next_experiment->motion.rows() > 0)
    write_trajectory(run.finding.next_experiment->motion, staging / kNextExperimentFile);
  write_file_atomically(staging / "series.json", diagnose_series_json(run.finding));
  write_file_atomically(staging / "result.json", diagnose_result_json(run));
  write_file_atomically(staging / "report.html", diagnose_page(read_diagnose_run(staging)));
  folder.publish(kRunFiles);  // a transfer's recordings there may be what was diagnosed
}

void publish_learn_run(const LearnRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_task(run.task, run.policies, staging);
  write_file_atomically(staging / "series.json", learn_series_json(run));
  write_file_atomically(staging / "result.json", learn_result_json(run));
  write_file_atomically(staging / "report.html", learn_page(read_learn_run(staging)));
  folder.publish(run_files(folder));
}

void publish_transfer_run(const TransferRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_task(run.task, run.policies, staging);
  write_file_atomically(staging / "series.json", transfer_series_json(run));
  write_file_atomically(staging / "result.json", transfer_result_json(run));
  write_file_atomically(staging / "report.html", transfer_page(read_transfer_run(staging)));
  folder.publish(run_files(folder));
}

}  // namespace diffnea
