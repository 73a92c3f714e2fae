#include <diffnea/runs/diagnosis.hpp>

#include "runs/ball_json.hpp"
#include "runs/fields_json.hpp"

namespace diffnea {
namespace {

constexpr const char* kSchema = "diffnea/diagnose/1";
constexpr const char* kSeriesSchema = "diffnea/diagnose-series/1";

/// @throws ModelError if the values of a plot or of a grid are not as many as their points
void check_points(const Finding& f, const std::string& where) {
  const auto check = [](const std::string& at, std::size_t points, const std::vector<double>& x) {
    if (x.size() != points)
      throw ModelError(at + ": has " + std::to_string(points) + " values, another column " +
                       std::to_string(x.size()));
  };
  const auto item = [](const std::string& list, std::size_t k) {
    return list + "[" + std::to_string(k) + "]";
  };
  for (std::size_t k = 0; k < f.grey_box.size(); ++k) {
    const GreyBox& g = f.grey_box[k];
    std::size_t points = 1;
    for (const std::vector<double>& values : g.at) points *= values.size();
    if (g.at.empty()) continue;
    check(item(where + ".grey_box", k) + ".at", points, g.torque);
    check(item(where + ".grey_box", k) + ".at", points, g.std);
  }
  for (std::size_t k = 0; k < f.plots.size(); ++k)
    for (std::size_t c = 0; c < f.plots[k].curves.size(); ++c)
      check(item(item(where + ".plots", k) + ".curves", c) + ".mean", f.plots[k].x.size(),
            f.plots[k].curves[c].mean);
}

}  // namespace

/// The path of series.json.
static io::Json custom_json(const Finding& f, const char*, RunFile) {
  return io::ball_columns(f.ball);
}
static void read_custom(Finding& f, const char*, io::JsonObject& series, RunFile) {
  io::read_ball_columns(series, f.ball);
}

std::string diagnose_result_json(const DiagnoseRun& run) {
  return io::file_text(kSchema, run, kInResult);
}

std::string diagnose_series_json(const Finding& finding) {
  return io::file_text(kSeriesSchema, finding, kInSeries);
}

DiagnoseRun read_diagnose_run(const std::filesystem::path& folder) {
  DiagnoseRun run;
  io::read_file(run, folder, kSchema, kInResult);
  if (const auto path = folder / "series.json"; std::filesystem::exists(path)) {
    io::read_file(run.finding, folder, kSeriesSchema, kInSeries);
    check_points(run.finding, path.string());
  }
  return run;
}

}  // namespace diffnea
