/// Diagnosis and what it finds.

#include <filesystem>
#include <memory>

#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/report/diagnose_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/version.hpp>

#include "bindings.hpp"
#include "choice.hpp"
#include "data.hpp"
#include "options.hpp"
#include "supervisor.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// A candidate of the caller's own: (name, joint, [(name, unit, sign)], function).
OwnCandidate own_candidate(const py::handle& item) {
  const py::tuple t = item.cast<py::tuple>();
  OwnCandidate out{t[0].cast<std::string>(), t[1].cast<std::string>(), {}, {}};
  for (const py::handle p : t[2]) {
    const auto [name, unit, sign] = p.cast<std::tuple<std::string, std::string, std::string>>();
    out.parameters.push_back(
        {.name = name,
         .unit = unit,
         .unit_prismatic = unit,
         .sign = choice<Sign>("diagnose: candidate '" + out.name + "': sign", sign,
                              {{"free", Sign::kFree},
                               {"nonnegative", Sign::kNonNegative},
                               {"positive", Sign::kPositive}})});
  }
  // Copies of the function are made and dropped by threads without the GIL: they share this one.
  const std::shared_ptr<py::object> function(new py::object(t[3].cast<py::object>()),
                                             [](py::object* o) {
                                               const py::gil_scoped_acquire gil;
                                               delete o;
                                             });
  out.columns = [function, name = out.name, width = static_cast<long>(out.parameters.size())](
                    const JointSeries& x) -> RowMatX<double> {
    const py::gil_scoped_acquire gil;
    const std::string what = "diagnose: candidate '" + name + "': ";
    try {
      const VecX<double> time = VecX<double>::LinSpaced(
          x.rows(), x.start, x.start + x.dt * static_cast<double>(x.rows() - 1));
      const py::object columns =
          (*function)(array_out(time), array_out(x.q), array_out(x.qd), array_out(x.qdd));
      return matrix_in(what + "its columns", columns, x.rows(), width);
    } catch (const py::error_already_set& e) {
      if (e.matches(PyExc_KeyboardInterrupt)) throw;
      throw DataError(what + "its function raised " + e.what());
    } catch (const py::builtin_exception& e) {
      throw DataError(what + "expected its function to return numbers: " + e.what());
    }
  };
  return out;
}

DiagnoseRun diagnose_python(const Model& model, const py::list& train_items,
                            const py::list& test_items, const py::list& candidates,
                            const py::dict& given, const std::optional<std::string>& torque_side,
                            const std::vector<std::string>& passive,
                            const std::vector<std::string>& joints,
                            const std::vector<std::string>& lock, const py::object& progress) {
  DiagnoseOptions options;
  set_options(options, "diagnose", given);
  for (const py::handle c : candidates) options.candidates.push_back(own_candidate(c));
  Supervisor supervisor(progress);
  options.progress = [&supervisor](const FitProgress& p) { return supervisor(p); };

  const Data train(train_items), test(test_items);
  DiagnoseRun run;
  run.reproduce.version = version();
  run.reproduce.command = {"diffnea.diagnose"};
  run.finding = on_recordings(
      model, train, test, {torque_side, passive, {joints, lock}}, supervisor, run.reproduce.inputs,
      [&](const Model& served, const RecordingSource& data, const RecordingSource* held_out) {
        return diagnose(served, data, held_out, options);
      });
  return run;
}

/// What `diffnea diagnose -o path` leaves there.
void save_diagnosis(DiagnoseRun run, const std::filesystem::path& path) {
  check_run_folder(path, "diagnose");
  ResultFolder folder(path);
  publish_diagnose_run(run, folder);
}

/// Value types that a diagnosis holds.
void bind_finding_parts(py::module_& m) {
  value_type<CauseParameter>(m);
  value_type<Rival>(m);
  value_type<Gain>(m);
  value_type<Cause>(m);
  value_type<Refusal>(m);
  value_type<CandidateScore>(m);
  value_type<Witness>(m);
  value_type<GreyBox>(m);
  value_type<Absorbed>(m);
  value_type<JointGain>(m);
  value_type<RefutedNumber>(m);
  value_type<EvidenceCurve>(m);
  value_type<EvidencePlot>(m);
  value_type<ExperimentPair>(m);
  value_type<NextExperiment>(m);
  constexpr const char* kSeries = "The series as a pandas data frame, a row an instant.";
  auto residual = value_type<ResidualSeries>(m);
  def_to_frame(residual, kSeries);
  auto simulated = value_type<SimulatedSeries>(m);
  def_to_frame(simulated, kSeries);
  value_type<SimulatedHorizon>(m);
  value_type<ApartWindow>(m);
  auto motion = value_type<SimulatedMotion>(m);
  def_to_frame(motion, "The series of all joints, told apart by a column ``joint``.");
}

void bind_finding(py::module_& m) {
  auto c = value_type<DiagnoseRun>(m, {.repr = true, .to_dict = true, .html = true});
  redefine(c, "parameters", "Parameters", [](const DiagnoseRun& run) {
    return python_function("diffnea._results", "Parameters")(py::cast(run.finding.parameters));
  });
  c.def(
       "to_dict", [](const DiagnoseRun& run) { return parse_json(diagnose_result_json(run)); },
       "The content of result.json, schema ``diffnea/diagnose/1``.")
      .def("save", &save_diagnosis, "folder"_a, py::call_guard<py::gil_scoped_release>(),
           "Write what ``diffnea diagnose -o folder`` leaves there: result.json, series.json, the "
           "extended\nmodel.json and report.html. Raises :class:`FileError` where that would "
           "replace "
           "another\ncommand's result, or files that diffnea did not leave.")
      .def(
          "plot",
          [](const DiagnoseRun& run, const std::optional<std::vector<std::string>>& joints) {
            return python_function("diffnea._results", "plot_finding")(run, joints);
          },
          py::kw_only(), "joints"_a = py::none(),
          "Draw torque over time and its error over velocity, before and after, for every joint "
          "that a\ncause or a witness names (all, if none does), or for those given; return the "
          "matplotlib\nfigure.")
      .def(
          "plot_ball",
          [](const DiagnoseRun& run) {
            return python_function("diffnea._ball", "plot_result")(
                run.finding.ball, py::make_tuple("base model", "extended model"),
                "Finding.plot_ball");
          },
          "Draw the ball's path in space, the string's length, the error over the string's "
          "direction and\nover time with matplotlib; return the figure.")
      .def("__repr__",
           [](const DiagnoseRun& run) {
             return "Finding(" + std::string(py::repr(py::str(run.finding.model.name))) + ": " +
                    name_of(run.finding.verdict) + ". " + run.finding.sentence + ")";
           })
      .def("__str__", &diagnose_text)
      .def(
          "_repr_html_",
          [](const DiagnoseRun& run) {
            return python_function("diffnea._results", "finding_html")(run);
          },
          "The verdict and small tables for notebooks.");
  def_to_frame(c, "The causes as a pandas data frame, a row for each of their parameters.");
}

}  // namespace

void bind_diagnose(py::module_& m) {
  bind_finding_parts(m);
  bind_finding(m);
  m.def("_diagnose", &diagnose_python, "model"_a, "train"_a, "test"_a, "candidates"_a, "options"_a,
        "torque_side"_a, "passive"_a, "joints"_a, "lock"_a, "progress"_a);
  m.def("_diagnose_options", &list_options<DiagnoseOptions>);
}

}  // namespace diffnea::python
