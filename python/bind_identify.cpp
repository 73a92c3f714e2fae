/// Identification, its result, and the comparison of two results.

#include <filesystem>
#include <memory>

#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/compare.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/version.hpp>

#include "bindings.hpp"
#include "choice.hpp"
#include "data.hpp"
#include "supervisor.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;
namespace fs = std::filesystem;

FitRun identify_python(const Model& model, const py::list& train_items, const py::list& test_items,
                       const std::string& loss, const std::string& robust,
                       const std::vector<std::string>& fit,
                       const std::optional<std::vector<std::string>>& effects,
                       const std::vector<std::string>& fix, double entropic_prior, bool physical,
                       double filter_hz, double decimate_to_hz, double window, double ball_window,
                       const std::array<double, 3>& ball_lambda, int max_passes, int threads,
                       const std::optional<std::string>& torque_side,
                       const std::vector<std::string>& passive, const py::object& progress) {
  IdentifyOptions options;
  if (loss == "constrained")
    options.ball.loss = BallLoss::kConstrained;
  else
    options.loss = choice<Loss>("identify: loss", loss,
                                {{"inverse", Loss::kInverse},
                                 {"forward", Loss::kForward},
                                 {"trajectory", Loss::kTrajectory},
                                 {"constrained", Loss::kInverse}});
  options.ball.window = ball_window;
  options.ball.lambda = ball_lambda;
  options.robust = choice<Robust>(
      "identify: robust", robust,
      {{"none", Robust::kNone}, {"huber", Robust::kHuber}, {"cauchy", Robust::kCauchy}});
  options.choice.fit = fit;
  options.choice.effects = effects;
  options.choice.fix = fix;
  options.linear.entropic_prior = entropic_prior;
  options.linear.physical = physical;
  options.preprocess.filter_hz = filter_hz;
  options.preprocess.decimate_to_hz = decimate_to_hz;
  options.trajectory.window = window;
  options.trajectory.threads = threads;
  options.max_passes = max_passes;
  Supervisor supervisor(progress);
  options.progress = [&supervisor](const FitProgress& p) { return supervisor(p); };

  const Data train(train_items), test(test_items);
  FitRun run;
  run.reproduce.version = version();
  run.reproduce.command = {"diffnea.identify"};
  run.fit =
      on_recordings(model, train, test, {torque_side, passive}, supervisor, run.reproduce.inputs,
                    [&](const RecordingSource& data, const RecordingSource* held_out) {
                      return identify(model, data, held_out, options);
                    });
  return run;
}

/// What `diffnea identify -o path` leaves there.
void save(FitRun run, const fs::path& path) {
  check_run_folder(path, "identify");
  ResultFolder folder(path);
  publish_fit_run(run, folder);
}

template <class F>
auto of_fit(F IdentifyResult::* member) {
  return [member](const FitRun& run) { return detail::to_python(run.fit.*member); };
}

void bind_parts(py::module_& m) {
  value_type<FitProgress>(
      m, "FitProgress", "Where a fit stands.",
      field("stage", &FitProgress::stage, "What is being done: ``reading``, ``fitting``, …"),
      field("iteration", &FitProgress::iteration, "Of the stage."),
      field("rows", &FitProgress::rows, "Rows read."),
      field("objective", &FitProgress::objective, "Of the last iteration, in units of χ²/2."));
  value_type<ParameterEstimate>(
      m, "ParameterEstimate", "One fitted parameter.",
      field("name", &ParameterEstimate::name,
            "``forearm.mass``, ``elbow.coulomb_friction.coulomb``"),
      field("unit", &ParameterEstimate::unit, "SI unit."),
      field("value", &ParameterEstimate::value, "Fitted value."),
      field("std", &ParameterEstimate::std,
            "Standard error; 0 where held, NaN if not identifiable."),
      field("prior", &ParameterEstimate::prior, "Value before the fit."),
      field("identifiable", &ParameterEstimate::identifiable, "The data alone determine it."),
      field("fixed", &ParameterEstimate::fixed, "It was held at the model's value."),
      field("at_bound", &ParameterEstimate::at_bound,
            "The optimum lies on the boundary of what is physically possible."));
  value_type<BaseParameter>(
      m, "BaseParameter", "A combination of parameters that the data determine by themselves.",
      field("expression", &BaseParameter::expression, "``upper_arm.Izz + 0.055 forearm.mass``"),
      field("value", &BaseParameter::value, "Fitted value."),
      field("std", &BaseParameter::std, "Standard error."),
      field("columns", &BaseParameter::columns,
            "Indices of the parameters, the leading one first."),
      field("coefficients", &BaseParameter::coefficients, "Their coefficients."));
  value_type<JointError>(
      m, "JointError",
      "Root mean square of one joint's torque error [N·m] or [N]; with the trajectory loss of its "
      "position's [rad] or [m]; of ``ball``: of its position's along one axis [m].",
      field("joint", &JointError::joint, "The joint's name, or ``ball``."),
      field("unit", &JointError::unit,
            "``N*m`` or ``N``; trajectory loss: ``rad`` or ``m``; of ``ball``: ``m``."),
      field("torque_rms", &JointError::torque_rms,
            "Of the measured torque: held out, else of the training data. Trajectory loss: NaN; of "
            "``ball``: of its position about its mean."),
      field("train", &JointError::train, "Of the filtered, decimated series that was fitted."),
      field("nominal_train", &JointError::nominal_train, "The same before the fit."),
      field("test", &JointError::test, "Held out; NaN without a test set."),
      field("nominal_test", &JointError::nominal_test, "The same before the fit."),
      field("test_raw", &JointError::test_raw,
            "Held out, of the unfiltered torque. Trajectory loss: each window from its measured "
            "state; of ``ball``: with rows that the fit's path contradicts."),
      field("test_all", &JointError::test_all,
            "Held out, samples at which the joint rests included."));
  auto torque = value_type<TorqueSeries>(
      m, "TorqueSeries",
      "Torque of one joint over time, filtered and decimated; with the trajectory loss its "
      "position, simulated window by window.",
      field("joint", &TorqueSeries::joint, "The joint's name."),
      field("unit", &TorqueSeries::unit, "``N*m`` or ``N``; trajectory loss: ``rad`` or ``m``."),
      field("time", &TorqueSeries::time, "(M,) [s]"),
      field("measured", &TorqueSeries::measured, "(M,) measured."),
      field("fitted", &TorqueSeries::fitted, "(M,) of the model as fitted."),
      field("nominal", &TorqueSeries::nominal, "(M,) of the model before the fit."),
      field("velocity", &TorqueSeries::velocity,
            "(M,) of the joint [rad/s] or [m/s]; empty with the trajectory loss."));
  def_to_frame(torque, "The series as a pandas data frame, a row an instant.");
  value_type<TorqueConstant>(
      m, "TorqueConstant", "A torque constant that the fit corrected.",
      field("joint", &TorqueConstant::joint, "The joint's name."),
      field("unit", &TorqueConstant::unit, "``N*m/A`` or ``N/A``."),
      field("assumed", &TorqueConstant::assumed, "What the recorded torques were made with."),
      field("value", &TorqueConstant::value, "Assumed / (1 + gain_error)."),
      field("std", &TorqueConstant::std, "Standard error; NaN if not identifiable."));
  value_type<FitSummary>(
      m, "FitSummary", "How the fit went.",
      field("converged", &FitSummary::converged, "It reached its stop rule."),
      field("interrupted", &FitSummary::interrupted,
            "It was stopped; the result is of what had been read."),
      field("termination", &FitSummary::termination, "Why it ended."),
      field("iterations", &FitSummary::iterations, "Newton steps of the last fit."),
      field("passes", &FitSummary::passes, "Over the data."),
      field("rows", &FitSummary::rows, "Of the recordings."),
      field("fitted_rows", &FitSummary::fitted_rows, "Torque samples that were fitted."),
      field("seconds", &FitSummary::seconds, "In all."),
      field("seconds_fitting", &FitSummary::seconds_fitting,
            "Of them before the errors are computed; reading counts."));
  value_type<DecimatorOptions>(
      m, "DecimatorOptions", "The low-pass and decimation of torques and regressor.",
      field("rate_hz", &DecimatorOptions::rate_hz, "Of the rows that enter [Hz]."),
      field("factor", &DecimatorOptions::factor, "Rows that enter per row that is fitted."),
      field("pass_hz", &DecimatorOptions::pass_hz, "Kept up to here [Hz]; 0: chosen."),
      field("stop_hz", &DecimatorOptions::stop_hz, "Suppressed from here [Hz]; 0: chosen."),
      field("attenuation_db", &DecimatorOptions::attenuation_db, "Ripple and suppression [dB]."));
  value_type<PreprocessPlan>(
      m, "PreprocessPlan", "How the recordings were filtered.",
      field("dt", &PreprocessPlan::dt, "Of the uniform grid [s]."),
      field("filter_hz", &PreprocessPlan::filter_hz, "Cut-off of the Butterworth filter [Hz]."),
      field("order", &PreprocessPlan::order, "Its order."),
      field("decimator", &PreprocessPlan::decimator, "Low-pass of torques and regressor."),
      field("max_gap", &PreprocessPlan::max_gap, "A longer pause splits [periods]."),
      field("min_segment", &PreprocessPlan::min_segment, "A shorter segment was dropped [s]."),
      field("measured_velocity", &PreprocessPlan::measured_velocity, "qd as measured, not from q."),
      field("joint_hz", &PreprocessPlan::joint_hz, "(n,) cut-off for each joint alone [Hz]."),
      field("q_noise", &PreprocessPlan::q_noise, "(n,) noise of q [rad] or [m]."),
      field("tau_noise", &PreprocessPlan::tau_noise, "(n,) white noise of tau [N·m] or [N]."),
      field("timing_jitter", &PreprocessPlan::timing_jitter,
            "Share of intervals off dt by over 2 %."));
  value_type<RunInput>(m, "RunInput", "A file that went into a run.",
                       field("role", &RunInput::role, "``model``, ``data`` or ``test``."),
                       field("path", &RunInput::path, "As it was given."),
                       field("bytes", &RunInput::bytes, "Its size."),
                       field("sha256", &RunInput::sha256, "Hexadecimal; empty for large files."));
  value_type<Reproduce>(m, "Reproduce", "What it takes to get the same result again.",
                        field("version", &Reproduce::version, "Of diffnea."),
                        field("command", &Reproduce::command, "The arguments."),
                        field("inputs", &Reproduce::inputs, "The files."));
  using R = IdentifyResult;
  value_type<R>(
      m, "_Fit", "The part of an IdentifyResult that the library fills.",
      field("model", &R::model, ""), field("parameters", &R::parameters, ""),
      field("base_parameters", &R::base_parameters, ""),
      field("torque_constants", &R::torque_constants, ""), field("errors", &R::errors, ""),
      field("boundary", &R::boundary, ""), field("consistency_cost", &R::consistency_cost, ""),
      field("physically_consistent", &R::physically_consistent, ""), field("plan", &R::plan, ""),
      field("data_report", &R::data_report, ""), field("notes", &R::notes, ""),
      field("train_series", &R::train_series, ""), field("test_series", &R::test_series, ""),
      field("ball", &R::ball, ""), field("summary", &R::summary, ""))
      .attr("__module__") = "diffnea._core";
}

void bind_result(py::module_& m) {
  using R = IdentifyResult;
  py::class_<FitRun> c(m, "IdentifyResult",
                       "A fit: the model with uncertainties, and how well it predicts.");
  c.def_property_readonly("model", of_fit(&R::model),
                          "The model with fitted values, effects and posterior.")
      .def_property_readonly(
          "parameters",
          [](const FitRun& run) {
            return python_function("diffnea._results", "Parameters")(py::cast(run.fit.parameters));
          },
          "The fitted parameters: a list of :class:`ParameterEstimate`, also by name; "
          "``.to_frame()``.")
      .def_property_readonly(
          "base_parameters", of_fit(&R::base_parameters),
          "Combinations that the data determine, a list of :class:`BaseParameter`.")
      .def_property_readonly(
          "torque_constants", of_fit(&R::torque_constants),
          "Torque constants where a gain was fitted and the recording names one, a list of "
          ":class:`TorqueConstant`.")
      .def_property_readonly("errors", of_fit(&R::errors),
                             "Torque error of every joint, a list of :class:`JointError`.")
      .def_property_readonly("boundary", of_fit(&R::boundary),
                             "Links on the boundary of physical consistency.")
      .def_property_readonly("consistency_cost", of_fit(&R::consistency_cost),
                             "What consistency costs [χ²/2].")
      .def_property_readonly("physically_consistent", of_fit(&R::physically_consistent),
                             "Every link is one that some distribution of mass can be.")
      .def_property_readonly("plan", of_fit(&R::plan), "How the recordings were filtered.")
      .def_property_readonly("data_report", of_fit(&R::data_report),
                             "What reading the files brought up.")
      .def_property_readonly("notes", of_fit(&R::notes),
                             "What a reader should know, one sentence each.")
      .def_property_readonly("train_series", of_fit(&R::train_series),
                             "Measured and predicted torque, a list of :class:`TorqueSeries`.")
      .def_property_readonly("test_series", of_fit(&R::test_series), "The same, held out.")
      .def_property_readonly("ball", of_fit(&R::ball),
                             "The ball's path, a :class:`BallSeries`; None where none was fitted.")
      .def_property_readonly("summary", of_fit(&R::summary), "How the fit went.")
      .def_property_readonly(
          "reproduce", [](const FitRun& run) { return run.reproduce; }, "Version and input files.")
      .def(
          "to_dict", [](const FitRun& run) { return parse_json(identify_result_json(run)); },
          "The content of result.json, schema ``diffnea/identify/1``.")
      .def(
          "to_frame",
          [](const FitRun& run) { return py::cast(run).attr("parameters").attr("to_frame")(); },
          "The parameters as a pandas data frame.")
      .def("save", &save, "folder"_a, py::call_guard<py::gil_scoped_release>(),
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
  def_pickle(c, field("fit", &FitRun::fit, ""), field("reproduce", &FitRun::reproduce, ""));
  c.attr("__module__") = "diffnea";
}

void bind_compare(py::module_& m) {
  value_type<Change>(
      m, "Change", "One quantity in two fits.",
      field("name", &Change::name, "Parameter or expression."),
      field("unit", &Change::unit, "SI unit."),
      field("before", &Change::before, "In the first fit."),
      field("after", &Change::after, "In the second."),
      field("std", &Change::std, "Standard error of the difference."),
      field("z", &Change::z, "Difference over its standard error."),
      field("p", &Change::p,
            "Chance of such a z without a change, adjusted for the number of tests."),
      field("significant", &Change::significant, "The change is more than chance explains."));
  value_type<LeftOver>(
      m, "LeftOver", "What each of two fits leaves of its own recording at one joint.",
      field("joint", &LeftOver::joint, "Its name, or ``ball``."),
      field("unit", &LeftOver::unit, "SI unit."),
      field("before", &LeftOver::before, "RMS of the series that was fitted, by the first fit."),
      field("after", &LeftOver::after, "By the second."));
  auto comparison = value_type<Comparison>(
      m, "Comparison", "What changed between two fits of one robot.",
      field("joints", &Comparison::joints, "Of both fits."),
      field("base_parameters", &Comparison::base_parameters,
            "Combinations that both fits see, most significant first; a list of :class:`Change`."),
      field("parameters", &Comparison::parameters, "Parameters that both fits see by themselves."),
      field("left_over", &Comparison::left_over,
            "A :class:`LeftOver` for each joint that both fit by the same loss."),
      field("std_ratio", &Comparison::std_ratio,
            "Median of the second fit's standard errors over the first's; NaN without any."),
      field("only_before", &Comparison::only_before, "Parameters that the first fit alone has."),
      field("only_after", &Comparison::only_after, "Parameters that the second fit alone has."),
      field("not_comparable", &Comparison::not_comparable,
            "Combinations of the first fit that the second does not see."),
      field("changed", &Comparison::changed, "A combination changed significantly."));
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
  bind_parts(m);
  bind_result(m);
  bind_compare(m);
  m.def("_identify", &identify_python, "model"_a, "data"_a, "test"_a, "loss"_a, "robust"_a, "fit"_a,
        "effects"_a, "fix"_a, "entropic_prior"_a, "physical"_a, "filter_hz"_a, "decimate_to_hz"_a,
        "window"_a, "ball_window"_a, "ball_lambda"_a, "max_passes"_a, "threads"_a, "torque_side"_a,
        "passive"_a, "progress"_a);
  m.def("read_result", &read_fit_run, "folder"_a, py::call_guard<py::gil_scoped_release>(),
        "Read the result that a run left in a folder: that of ``diffnea identify -o``, or of "
        "``save``.");
}

}  // namespace diffnea::python
