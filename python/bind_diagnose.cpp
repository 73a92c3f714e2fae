/// Diagnosis and what it finds.

#include <filesystem>
#include <memory>

#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/report/diagnose_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/version.hpp>

#include "bindings.hpp"
#include "choice.hpp"
#include "data.hpp"
#include "supervisor.hpp"
#include "value_type.hpp"

namespace pybind11::detail {

/// "NAMED", "CLASS", "UNKNOWN", "NONE", "NOT_IDENTIFIABLE".
template <>
struct type_caster<diffnea::Verdict> {
  PYBIND11_TYPE_CASTER(diffnea::Verdict, const_name("str"));
  bool load(handle source, bool) {
    if (!isinstance<str>(source)) return false;
    value = diffnea::verdict_from(source.cast<std::string>());
    return true;
  }
  static handle cast(diffnea::Verdict verdict, return_value_policy, handle) {
    return str(diffnea::name_of(verdict)).release();
  }
};

}  // namespace pybind11::detail

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
                            const py::list& test_items, const std::string& base,
                            const std::vector<std::string>& effects, const py::list& candidates,
                            bool grey_box, double filter_hz, double decimate_to_hz, int max_causes,
                            std::uint64_t seed, const std::optional<std::string>& torque_side,
                            const std::vector<std::string>& passive, const py::object& progress) {
  DiagnoseOptions options;
  options.base = choice<Base>("diagnose: base", base,
                              {{"auto", Base::kAuto},
                               {"refit", Base::kRefit},
                               {"prior", Base::kPrior},
                               {"fixed", Base::kFixed}});
  options.effects = effects;
  for (const py::handle c : candidates) options.candidates.push_back(own_candidate(c));
  options.grey_box = grey_box;
  options.preprocess.filter_hz = filter_hz;
  options.preprocess.decimate_to_hz = decimate_to_hz;
  options.max_causes = max_causes;
  options.seed = seed;
  Supervisor supervisor(progress);
  options.progress = [&supervisor](const FitProgress& p) { return supervisor(p); };

  const Data train(train_items), test(test_items);
  DiagnoseRun run;
  run.reproduce.version = version();
  run.reproduce.command = {"diffnea.diagnose"};
  run.finding =
      on_recordings(model, train, test, {torque_side, passive}, supervisor, run.reproduce.inputs,
                    [&](const RecordingSource& data, const RecordingSource* held_out) {
                      return diagnose(model, data, held_out, options);
                    });
  return run;
}

/// What `diffnea diagnose -o path` leaves there.
void save(DiagnoseRun run, const std::filesystem::path& path) {
  check_run_folder(path, "diagnose");
  ResultFolder folder(path);
  publish_diagnose_run(run, folder);
}

void bind_cause(py::module_& m) {
  value_type<CauseParameter>(m, "CauseParameter", "One parameter of a cause.",
                             field("name", &CauseParameter::name, "As ``effects()`` names it."),
                             field("unit", &CauseParameter::unit, "SI unit."),
                             field("value", &CauseParameter::value, "Estimate."),
                             field("std", &CauseParameter::std, "Standard error; NaN if held."),
                             field("low", &CauseParameter::low, "Lower end, 95 % interval."),
                             field("high", &CauseParameter::high, "Upper end, 95 % interval."));
  value_type<Rival>(
      m, "Rival", "Another effect in the place of a cause.",
      field("effect", &Rival::effect, "Its name."),
      field("where", &Rival::where, "Joint, pair of joints, ``tip``, ``base`` or ``all``."),
      field("delta_bic", &Rival::delta_bic, "How much worse the fit is with it instead."));
  value_type<Gain>(
      m, "Gain",
      "What causes gain on held-out data. Errors are of filtered, decimated torque, each joint's "
      "over its noise.",
      field("before", &Gain::before, "Root mean square without them."),
      field("after", &Gain::after, "With them."),
      field("noise_floor", &Gain::noise_floor,
            "What no smooth function of the motion removes either."),
      field("explained_share", &Gain::explained_share, "Of the removable mean square."),
      field("low", &Gain::low,
            "Removed share of the mean square: lower end of the 95 % interval (block bootstrap)."),
      field("high", &Gain::high, "Its upper end."));
  value_type<Cause>(
      m, "Cause", "An effect that the model lacks.", field("effect", &Cause::effect, "Its name."),
      field("where", &Cause::where, "Joint, pair of joints, ``tip``, ``base`` or ``all``."),
      field("verdict", &Cause::verdict,
            "``NAMED``; ``CLASS`` if ``members`` do as well; ``UNKNOWN``: a learned remainder."),
      field("parameters", &Cause::parameters, "A list of :class:`CauseParameter`."),
      field("delta_bic", &Cause::delta_bic, "Of leaving it out."),
      field("lm", &Cause::lm, "χ² that it takes away, the base refitted."),
      field("visible_share", &Cause::visible_share,
            "Of its torque: what the base parameters cannot take over."),
      field("torque_share", &Cause::torque_share,
            "Root mean square of its torque over that of its joint's torque."),
      field("members", &Cause::members,
            "Its class without itself: effects that this recording cannot tell from it; a list of "
            ":class:`Rival`."),
      field("rivals", &Cause::rivals, "The next ones, a list of :class:`Rival`."),
      field("gain", &Cause::gain, "Of this cause alone, the others in place."));
}

void bind_rest(py::module_& m) {
  value_type<Refusal>(m, "Refusal", "A candidate that could not be tested, or was refused.",
                      field("effect", &Refusal::effect, "Its name."),
                      field("where", &Refusal::where, "Its place."),
                      field("reason", &Refusal::reason, "Why."),
                      field("delta_bic", &Refusal::delta_bic, "What it would have gained."));
  value_type<CandidateScore>(
      m, "CandidateScore", "A candidate before anything was accepted.",
      field("effect", &CandidateScore::effect, "Its name."),
      field("where", &CandidateScore::where, "Its place."),
      field("delta_bic", &CandidateScore::delta_bic, "Of adding it to the base model."),
      field("lm", &CandidateScore::lm, "χ² that it takes away, the base refitted."),
      field("visible_share", &CandidateScore::visible_share,
            "Of its torque: what the base parameters cannot take over."),
      field("shape", &CandidateScore::shape,
            "Its shape parameters where it scored best, as the search first tries them."));
  value_type<Witness>(m, "Witness", "What the error that is left depends on.",
                      field("where", &Witness::where, "The joint."),
                      field("variables", &Witness::variables, "Channels, e.g. ``q_elbow``."),
                      field("share", &Witness::share, "Of the mean square of the joint's error."),
                      field("delta_bic", &Witness::delta_bic, "Of a smooth function of them."));
  value_type<GreyBox>(
      m, "GreyBox",
      "What was learned without a name at one joint, where no effect explains what is left: the "
      "torque of the\neffect ``residual`` over the variables of the witness. No physics.",
      field("where", &GreyBox::where, "The joint."),
      field("unit", &GreyBox::unit, "Of the torque."),
      field("variables", &GreyBox::variables, "One or two channels, e.g. ``q_elbow``."),
      field("units", &GreyBox::units, "Of these."),
      field("bumps", &GreyBox::bumps, "Of its table."),
      field("effective_parameters", &GreyBox::effective_parameters, "That the fit spent on them."),
      field("bound", &GreyBox::bound, "Most that it ever gives: the most that was seen."),
      field("torque_rms", &GreyBox::torque_rms, "Its root mean square on held-out data."),
      field("before", &GreyBox::before, "Root mean square of the held-out error without it."),
      field("after", &GreyBox::after, "And with it."),
      field("at", &GreyBox::at, "Grid to draw it on: values of each variable."),
      field("torque", &GreyBox::torque, "On that grid, the last variable fastest."),
      field("std", &GreyBox::std, "Its standard deviation there."));
  value_type<Absorbed>(m, "Absorbed",
                       "An effect that this recording cannot show beside the base parameters.",
                       field("effect", &Absorbed::effect, "Its name."),
                       field("where", &Absorbed::where, "Its place."),
                       field("visible_share", &Absorbed::visible_share, "Of its torque."));
  value_type<JointGain>(
      m, "JointGain", "Root mean square of one joint's held-out torque error [N·m] or [N].",
      field("joint", &JointGain::joint, "The joint's name."),
      field("unit", &JointGain::unit, "Of the torque."),
      field("torque_rms", &JointGain::torque_rms, "Of the measured torque."),
      field("base", &JointGain::base, "Of the base model, refitted as ``base`` allows."),
      field("extended", &JointGain::extended, "With all causes."),
      field("noise_floor", &JointGain::noise_floor, "Of the noise."));
  auto residual = value_type<ResidualSeries>(
      m, "ResidualSeries", "Torque of one joint over the held-out rows, filtered and decimated.",
      field("joint", &ResidualSeries::joint, "The joint's name."),
      field("unit", &ResidualSeries::unit, "Of the torque."),
      field("time", &ResidualSeries::time, "(M,) [s]"),
      field("measured", &ResidualSeries::measured, "(M,) measured torque."),
      field("base", &ResidualSeries::base, "(M,) of the base model."),
      field("extended", &ResidualSeries::extended, "(M,) of the model with all causes."),
      field("q", &ResidualSeries::q, "(M,) position [rad] or [m]."),
      field("qd", &ResidualSeries::qd, "(M,) velocity."),
      field("qdd", &ResidualSeries::qdd, "(M,) acceleration."));
  def_to_frame(residual, "The series as a pandas data frame, a row an instant.");
}

void bind_simulated(py::module_& m) {
  using S = SimulatedSeries;
  auto series =
      value_type<S>(m, "SimulatedSeries",
                    "One joint's motion over held-out windows, measured and simulated again.",
                    field("joint", &S::joint, "The joint's name."),
                    field("unit", &S::unit, "Of the position, rad or m."),
                    field("time", &S::time, "(M,) [s]; windows follow each other."),
                    field("measured", &S::measured, "(M,) filtered position."),
                    field("base", &S::base, "(M,) of the base model; NaN where a window ends."),
                    field("extended", &S::extended, "(M,) of the extended model; NaN likewise."),
                    field("base_rmse", &S::base_rmse, "Root mean square error of the base model."),
                    field("extended_rmse", &S::extended_rmse, "Of the extended model."));
  def_to_frame(series, "The series as a pandas data frame, a row an instant.");
  using M = SimulatedMotion;
  auto motion =
      value_type<M>(m, "SimulatedMotion",
                    "Held-out motion simulated again, each window from its measured state on.",
                    field("driven_by", &M::driven_by, "``controller`` or ``measured torque``."),
                    field("window", &M::window, "Its length [s]."),
                    field("windows", &M::windows, "How many were tried."),
                    field("base_failed", &M::base_failed, "In how many the base model blew up."),
                    field("extended_failed", &M::extended_failed, "And the extended model."),
                    field("reason", &M::reason, "Why there is none; empty if there is."),
                    field("joints", &M::joints, "A list of :class:`SimulatedSeries`."));
  def_to_frame(motion, "The series of all joints, told apart by a column ``joint``.");
}

template <class F>
auto of_finding(F Finding::* member) {
  return [member](const DiagnoseRun& run) { return detail::to_python(run.finding.*member); };
}

void bind_plots(py::module_& m) {
  value_type<EvidenceCurve>(
      m, "EvidenceCurve", "One line of a plot: means with their 95 % intervals.",
      field("model", &EvidenceCurve::model, "Whose error: ``base`` or ``extended``."),
      field("mean", &EvidenceCurve::mean,
            "Means, one for each ``x`` of the plot [``y_unit``]; NaN: none."),
      field("low", &EvidenceCurve::low, "Lower ends of their 95 % intervals."),
      field("high", &EvidenceCurve::high, "Upper ends of their 95 % intervals."));
  value_type<EvidencePlot>(
      m, "EvidencePlot", "What an effect looks like in the torque error of held-out rows.",
      field("kind", &EvidencePlot::kind, "``velocity``, ``position``, ``spectrum`` …"),
      field("joint", &EvidencePlot::joint, "Whose error."),
      field("x_name", &EvidencePlot::x_name, "Label of the horizontal axis."),
      field("x_unit", &EvidencePlot::x_unit, "Its unit."),
      field("y_name", &EvidencePlot::y_name, "Label of the vertical axis."),
      field("y_unit", &EvidencePlot::y_unit, "Its unit."),
      field("effect", &EvidencePlot::effect, "The cause; empty: an overview."),
      field("x", &EvidencePlot::x, "Where the curves have points, (n,) [``x_unit``]."),
      field("curves", &EvidencePlot::curves, "A list of :class:`EvidenceCurve`."),
      field("mark", &EvidencePlot::mark, "A ripple's own cycles [``x_unit``]; NaN: none."));
  value_type<ExperimentPair>(
      m, "ExperimentPair", "A cause and a rival of its class, and how clearly they differ.",
      field("effect", &ExperimentPair::effect, "The cause's effect."),
      field("where", &ExperimentPair::where, "Where it acts."),
      field("rival", &ExperimentPair::rival, "The rival's effect."),
      field("rival_where", &ExperimentPair::rival_where, "Where that would act."),
      field("delta_bic", &ExperimentPair::delta_bic, "In this recording."),
      field("expected_delta_bic", &ExperimentPair::expected_delta_bic,
            "In the next one, if the cause is the cause."));
  value_type<NextExperiment>(
      m, "NextExperiment", "A motion that would tell rivals apart.",
      field("sentence", &NextExperiment::sentence, "What to do, and what to expect of it."),
      field(
          "pairs", &NextExperiment::pairs,
          "In question, a list of :class:`ExperimentPair`; told apart are those that expect 10 or "
          "more."),
      field("expected_delta_bic", &NextExperiment::expected_delta_bic,
            "The smallest of the pairs that it tells apart."),
      field("trajectory", &NextExperiment::trajectory,
            "File beside the result; empty: no motion that was tried tells any pair apart."),
      field("motion", &NextExperiment::motion, "The :class:`Trajectory` to record."));
}

void bind_finding(py::module_& m) {
  using F = Finding;
  bind_plots(m);
  bind_simulated(m);
  value_type<F>(m, "_Diagnosis", "The part of a Finding that the library fills.",
                field("verdict", &F::verdict, ""), field("sentence", &F::sentence, ""),
                field("audit", &F::audit, ""), field("causes", &F::causes, ""),
                field("witness", &F::witness, ""), field("grey_box", &F::grey_box, ""),
                field("absorbed", &F::absorbed, ""), field("refused", &F::refused, ""),
                field("candidates", &F::candidates, ""), field("gain", &F::gain, ""),
                field("joints", &F::joints, ""), field("series", &F::series, ""),
                field("plots", &F::plots, ""), field("simulated", &F::simulated, ""),
                field("next_experiment", &F::next_experiment, ""),
                field("lack_of_fit", &F::lack_of_fit, ""),
                field("lack_of_fit_p", &F::lack_of_fit_p, ""), field("noise", &F::noise, ""),
                field("held_out", &F::held_out, ""), field("base", &F::base, ""),
                field("model", &F::model, ""), field("parameters", &F::parameters, ""),
                field("plan", &F::plan, ""), field("data_report", &F::data_report, ""),
                field("ball", &F::ball, ""), field("notes", &F::notes, ""),
                field("seconds", &F::seconds, ""), field("interrupted", &F::interrupted, ""))
      .attr("__module__") = "diffnea._core";
  py::class_<DiagnoseRun> c(m, "Finding",
                            "What a model lacks, with evidence, rivals and the gain.");
  const auto property = [&c](const char* name, auto member, const char* doc) {
    c.def_property_readonly(name, of_finding(member), doc);
  };
  property("verdict", &F::verdict,
           "``NAMED``, ``CLASS``, ``UNKNOWN``, ``NONE`` or ``NOT_IDENTIFIABLE``.");
  property("sentence", &F::sentence, "The verdict in words.");
  property("audit", &F::audit,
           "Faults of the channels, found before any dynamics; a list of :class:`ChannelFault`.");
  property("causes", &F::causes, "What the model lacks, a list of :class:`Cause`.");
  property("witness", &F::witness,
           "What the error that is left depends on, a list of :class:`Witness`.");
  property("grey_box", &F::grey_box,
           "What was learned without a name where the verdict is UNKNOWN, a list of "
           ":class:`GreyBox`.");
  property("absorbed", &F::absorbed, "Effects that cannot be seen, a list of :class:`Absorbed`.");
  property("refused", &F::refused, "Effects that were refused, a list of :class:`Refusal`.");
  property("candidates", &F::candidates,
           "All that was tried at the first step, best first; a list of :class:`CandidateScore`.");
  property("gain", &F::gain, "Of all causes together, on held-out data.");
  property("joints", &F::joints, "Held-out error of every joint, a list of :class:`JointGain`.");
  property("series", &F::series, "Held-out torques, a list of :class:`ResidualSeries`.");
  property("plots", &F::plots, "Evidence to draw, a list of :class:`EvidencePlot`.");
  property("simulated", &F::simulated,
           "Held-out motion, simulated before and after: a :class:`SimulatedMotion`.");
  property("ball", &F::ball,
           "The ball's path, a :class:`BallSeries`; None where there is no ball.");
  property("next_experiment", &F::next_experiment,
           "A :class:`NextExperiment`, or None where none is known.");
  property("lack_of_fit", &F::lack_of_fit,
           "χ² of the base model over its degrees of freedom; 1: noise alone.");
  property("lack_of_fit_p", &F::lack_of_fit_p,
           "Chance of the best candidate's χ² by noise, times the number of candidates.");
  property("noise", &F::noise,
           "Root mean square of the noise of each joint's filtered, decimated torque.");
  property("held_out", &F::held_out, "``test recording`` or ``time blocks``.");
  property("base", &F::base, "What of the base could move: ``refit``, ``prior`` or ``fixed``.");
  property("model", &F::model, "The extended model: base parameters as fitted, and the causes.");
  property("plan", &F::plan, "How the recordings were filtered.");
  property("data_report", &F::data_report, "What reading the files brought up.");
  property("notes", &F::notes, "What a reader should know, one sentence each.");
  property("seconds", &F::seconds, "In all.");
  property("interrupted", &F::interrupted, "It was stopped; what had been found is there.");
  c.def_property_readonly(
       "parameters",
       [](const DiagnoseRun& run) {
         return python_function("diffnea._results", "Parameters")(py::cast(run.finding.parameters));
       },
       "The base parameters that go with the causes: a list of :class:`ParameterEstimate`, also "
       "by name.")
      .def_property_readonly(
          "reproduce", [](const DiagnoseRun& run) { return run.reproduce; },
          "Version and input files.")
      .def(
          "to_dict", [](const DiagnoseRun& run) { return parse_json(diagnose_result_json(run)); },
          "The content of result.json, schema ``diffnea/diagnose/1``.")
      .def("save", &save, "folder"_a, py::call_guard<py::gil_scoped_release>(),
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
  def_pickle(c, field("finding", &DiagnoseRun::finding, ""),
             field("reproduce", &DiagnoseRun::reproduce, ""));
  c.attr("__module__") = "diffnea";
}

}  // namespace

void bind_diagnose(py::module_& m) {
  bind_cause(m);
  bind_rest(m);
  bind_finding(m);
  m.def("_diagnose", &diagnose_python, "model"_a, "train"_a, "test"_a, "base"_a, "effects"_a,
        "candidates"_a, "grey_box"_a, "filter_hz"_a, "decimate_to_hz"_a, "max_causes"_a, "seed"_a,
        "torque_side"_a, "passive"_a, "progress"_a);
}

}  // namespace diffnea::python
