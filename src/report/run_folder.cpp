#include <diffnea/core/error.hpp>
#include <diffnea/io/atomic_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/report/diagnose_page.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/run_folder.hpp>

namespace diffnea {
namespace {

namespace fs = std::filesystem;

/// The extension of the format that the model was read from; empty for JSON, or if the file is
/// gone.
std::string model_extension(const Model& model) {
  std::error_code error;
  if (model.source.empty() || !fs::is_regular_file(model.source, error)) return "";
  const std::string text = read_text_file(model.source);
  const std::size_t urdf = text.find("<robot"), mjcf = text.find("<mujoco");
  if (text.find_first_not_of(" \t\r\n\xEF\xBB\xBF") == text.find('{') || urdf == mjcf) return "";
  return urdf < mjcf ? ".urdf" : ".xml";
}

/// model.json, and the form that the model came in. @param notes  gains what that form cannot hold
void write_models(const Model& model, const fs::path& folder, std::vector<std::string>& notes) {
  write_model(model, folder / "model.json");
  const std::string extension = model_extension(model);
  if (extension.empty()) return;
  try {
    std::string left_out;
    for (const std::string& what : write_model(model, folder / ("model" + extension)))
      left_out += (left_out.empty() ? "" : ", ") + what;
    if (!left_out.empty())
      notes.push_back("model" + extension + " cannot hold: " + left_out + "; model.json does");
  } catch (const ModelError& error) {  // the file changed since it was read; the fit is not lost
    notes.push_back("model" + extension + " was not written: " + error.what());
  }
}

}  // namespace

void publish_fit_run(FitRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_models(run.fit.model, staging, run.fit.notes);
  write_file_atomically(staging / "series.json", series_json(run.fit));
  write_file_atomically(staging / "result.json", identify_result_json(run));
  // From what was written, so that `diffnea report` gives the same page.
  write_file_atomically(staging / "report.html", identify_page(read_fit_run(staging)));
  folder.publish(kRunFiles);
}

void publish_diagnose_run(DiagnoseRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_models(run.finding.model, staging, run.finding.notes);
  if (run.finding.next_experiment && run.finding.next_experiment->motion.rows() > 0)
    write_trajectory(run.finding.next_experiment->motion, staging / kNextExperimentFile);
  write_file_atomically(staging / "series.json", diagnose_series_json(run.finding));
  write_file_atomically(staging / "result.json", diagnose_result_json(run));
  write_file_atomically(staging / "report.html", diagnose_page(read_diagnose_run(staging)));
  folder.publish(kRunFiles);
}

}  // namespace diffnea
