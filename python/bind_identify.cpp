/// Identification, its result, and the comparison of two results.

#include <filesystem>
#include <memory>

#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/compare.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/version.hpp>

#include "bindings.hpp"
#include "data.hpp"
#include "options.hpp"
#include "supervisor.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;
namespace fs = std::filesystem;

FitRun identify_python(const Model& model, const py::list& train_items, const py::list& test_items,
                       const py::dict& given, const std::optional<std::string>& torque_side,
                       const std::vector<std::string>& passive,
                       const std::vector<std::string>& joints, const std::vector<std::string>& lock,
                       const py::object& progress) {
  IdentifyOptions options;
  set_options(options, "identify", given);
  Supervisor supervisor(progress);
  options.progress = [&supervisor](const FitProgress& p) { return supervisor(p); };

  const Data train(train_items), test(test_items);
  FitRun run;
  run.reproduce.version = version();
  run.reproduce.command = {"diffnea.identify"};
  run.fit = on_recordings(
      model, train, test, {torque_side, passive, {joints, lock}}, supervisor, run.reproduce.inputs,
      [&](const Model& served, const RecordingSource& data, const RecordingSource* held_out) {
        return identify(served, data, held_out, options);
      });
  return run;
}

/// What `diffnea identify -o path` leaves there.
void save_fit(FitRun run, const fs::path& path) {
  check_run_folder(path, "identify");
  ResultFolder folder(path);
  publish_fit_run(run, folder);
}

void bind_fit_parts(py::module_& m) {
  value_type<FitProgress>(m);
  value_type<ParameterEstimate>(m);
  value_type<BaseParameter>(m);
  value_type<HorizonError>(m);
  value_type<JointError>(m);
  auto torque = value_type<TorqueSeries>(m);
  def_to_frame(torque, "The series as a pandas data frame, a row an instant.");
  value_type<TorqueConstant>(m);
  value_type<FitSummary>(m);
  value_type<DecimatorOptions>(m);
  value_type<PreprocessPlan>(m);
  value_type<RunInput>(m);
  value_type<Reproduce>(m);
}

void bind_result(py::module_& m) {
  auto c = value_type<FitRun>(m, {.repr = true, .to_dict = true, .html = true});
  redefine(c, "parameters", "Parameters", [](const FitRun& run) {
    return python_function("diffnea._results", "Parameters")(py::cast(run.fit.parameters));
  });
  c.def(
       "to_dict", [](const FitRun& run) { return parse_json(identify_result_json(run)); },
       "The content of result.json, schema ``diffnea/identify/1``.")
      .def(
          "to_frame",
          [](const FitRun& run) { return py::cast(run).attr("parameters").attr("to_frame")(); },
          "The parameters as a pandas data frame.")
      .def("save", &save_fit, "folder"_a, py::call_guard<py::gil_scoped_release>(),
           "Write result.json, model.json, series.json, report.html and, where the model was read "
           "from one,\n"
           "model.urdf or model.xml: what ``diffnea identify -o folder`` leaves there. Raises\n"
           ":class:`FileError` where that would replace another command's result, or files that "
           "diffnea did not leave.")
      .def("report_html", &identify_page, "The report as one self-contained HTML page.")
      .def(
          "plot",
          [](const FitRun& run, const std::string& of) {
            return python_function("diffnea._results", "plot")(run, of);
          },
          py::kw_only(), "of"_a = "auto",
          "Draw measured and predicted torque of every joint with matplotlib; return the "
          "figure.\n\n"
          "``of``: ``test``, ``train``, or ``auto`` (held-out data where there are any).")
      .def(
          "plot_ball",
          [](const FitRun& run) {
            return python_function("diffnea._ball", "plot_result")(
                run.fit.ball, py::make_tuple("model before", "fitted"), "IdentifyResult.plot_ball");
          },
          "Draw the ball's path in space, the string's length, the error over the string's "
          "direction and\nover time with matplotlib; return the figure.")
      .def("__repr__",
           [](const FitRun& run) {
             long identifiable = 0;
             for (const ParameterEstimate& p : run.fit.parameters) identifiable += p.identifiable;
             return "IdentifyResult(" + std::string(py::repr(py::str(run.fit.model.name))) + ": " +
                    std::to_string(identifiable) + " of " +
                    std::to_string(run.fit.parameters.size()) + " parameters identifiable, " +
                    std::to_string(run.fit.base_parameters.size()) + " combinations; " +
                    (run.fit.summary.converged ? "converged" : "not converged: ") +
                    (run.fit.summary.converged ? "" : run.fit.summary.termination) + ". " +
                    identify_headline(run) + ")";
           })
      .def("__str__", &identify_text)
      .def(
          "_repr_html_",
          [](const FitRun& run) { return python_function("diffnea._results", "html")(run); },
          "A small table for notebooks.");
}

void bind_compare(py::module_& m) {
  value_type<Change>(m);
  value_type<LeftOver>(m);
  auto comparison = value_type<Comparison>(m, {.to_dict = true});
  comparison.def(
      "to_dict", [](const Comparison& x) { return parse_json(comparison_json(x)); },
      "The comparison as dict, schema ``diffnea/compare/1``.");
  def_to_frame(comparison,
               "The parameters that both fits see as a pandas data frame, a row a parameter.");
  m.def(
      "compare",
      [](const FitRun& before, const FitRun& after, double alpha) {
        return compare(before.fit, after.fit, {.alpha = alpha});
      },
      "before"_a, "after"_a, py::kw_only(), "alpha"_a = 0.05,
      py::call_guard<py::gil_scoped_release>(),
      "What changed between two fits of one robot. ``alpha``: chance of any false alarm in each "
      "list.");
}

}  // namespace

void bind_identify(py::module_& m) {
  bind_fit_parts(m);
  bind_result(m);
  bind_compare(m);
  m.def("_identify", &identify_python, "model"_a, "data"_a, "test"_a, "options"_a, "torque_side"_a,
        "passive"_a, "joints"_a, "lock"_a, "progress"_a);
  m.def("_identify_options", &list_options<IdentifyOptions>);
  m.def("read_result", &read_fit_run, "folder"_a, py::call_guard<py::gil_scoped_release>(),
        "Read the result that a run left in a folder: that of ``diffnea identify -o``, or of "
        "``save``.");
}

}  // namespace diffnea::python
