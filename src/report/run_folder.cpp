#include <diffnea/core/error.hpp>
#include <diffnea/io/atomic_file.hpp>
#include <diffnea/io/model_file.hpp>
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

}  // namespace

void publish_fit_run(FitRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_model(run.fit.model, staging / "model.json");
  if (const std::string extension = model_extension(run.fit.model); !extension.empty()) {
    try {
      std::string left_out;
      for (const std::string& what : write_model(run.fit.model, staging / ("model" + extension)))
        left_out += (left_out.empty() ? "" : ", ") + what;
      if (!left_out.empty())
        run.fit.notes.push_back("model" + extension + " cannot hold: " + left_out +
                                "; model.json does");
    } catch (const ModelError& error) {  // the file changed since it was read; the fit is not lost
      run.fit.notes.push_back("model" + extension + " was not written: " + error.what());
    }
  }
  write_file_atomically(staging / "series.json", series_json(run.fit));
  write_file_atomically(staging / "result.json", identify_result_json(run));
  // From what was written, so that `diffnea report` gives the same page.
  write_file_atomically(staging / "report.html", identify_page(read_fit_run(staging)));
  folder.publish(kFitRunFiles);
}

void publish_diagnose_run(const DiagnoseRun& run, ResultFolder& folder) {
  const fs::path& staging = folder.staging();
  write_model(run.finding.model, staging / "model.json");
  write_file_atomically(staging / "series.json", diagnose_series_json(run.finding));
  write_file_atomically(staging / "result.json", diagnose_result_json(run));
  folder.publish(kDiagnoseRunFiles);
}

}  // namespace diffnea
