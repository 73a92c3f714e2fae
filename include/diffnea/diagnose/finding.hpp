#pragma once
/// What a diagnosis says: plain data in the terms of `result.json` (docs/schema/diagnose.md).

#include <optional>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/diagnose/cause.hpp>
#include <diffnea/diagnose/described_drive.hpp>
#include <diffnea/diagnose/evidence_plot.hpp>
#include <diffnea/diagnose/held_out_torque.hpp>
#include <diffnea/diagnose/next_experiment.hpp>
#include <diffnea/diagnose/remainder.hpp>
#include <diffnea/diagnose/simulated_motion.hpp>
#include <diffnea/diagnose/tried.hpp>
#include <diffnea/diagnose/verdict.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/recording/audit.hpp>

namespace diffnea {

/// What a diagnosis found: verdict, causes, what is left, and the model that has them.
struct Finding {
  Verdict verdict = Verdict::kNone;
  Tried tried = Tried::kAll;
  std::string sentence;
  std::vector<Cause> causes;
  std::vector<Witness> witness;
  std::vector<GreyBox> grey_box;
  std::vector<Absorbed> absorbed;
  std::vector<Refusal> refused;
  std::vector<CandidateScore> candidates;
  Gain gain;
  std::vector<JointGain> joints;
  std::vector<RefutedNumber> drives;
  std::vector<ResidualSeries> series;
  std::vector<EvidencePlot> plots;
  SimulatedMotion simulated;
  std::optional<BallSeries> ball;
  std::vector<ChannelFault> audit;
  std::optional<NextExperiment> next_experiment;
  double lack_of_fit = 0.0;
  double lack_of_fit_p = 1.0;
  std::vector<double> noise;
  std::string held_out;
  std::string base;
  Model model;
  std::vector<ParameterEstimate> parameters;
  PreprocessPlan plan;
  ReadReport data_report;
  std::vector<std::string> notes;
  double seconds = 0.0;
  bool interrupted = false;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Finding", "What a model lacks, with evidence, rivals and the gain.",
              {.files = kInResult});
    list.also("model", &Finding::model, &Model::name, "Name of the robot.",
              {.files = kInBoth, .optional = true});
    list.field("verdict", &Finding::verdict,
               "``NAMED``, ``CLASS``, ``UNKNOWN``, ``NONE`` or ``NOT_IDENTIFIABLE``.");
    list.in_memory("tried", &Finding::tried,
                   "How much of the catalogue was tried: ``all``, ``some`` or ``nothing``.");
    list.field("sentence", &Finding::sentence, "The verdict in words.");
    list.field("base", &Finding::base,
               "What of the base could move: ``refit``, ``prior`` or ``fixed``.",
               {.optional = true, .choices = "refit|prior|fixed"});
    list.field("held_out", &Finding::held_out, "``test recording`` or ``time blocks``.",
               {.optional = true, .choices = "test recording|time blocks"});
    list.field(
        "audit", &Finding::audit,
        "Faults of the channels, found before any dynamics; a list of :class:`ChannelFault`.");
    list.field("causes", &Finding::causes, "What the model lacks, a list of :class:`Cause`.");
    list.field("witness", &Finding::witness,
               "What the error that is left depends on, a list of :class:`Witness`.");
    list.field("series", &Finding::series, "Held-out torques, a list of :class:`ResidualSeries`.",
               {.key = "joints", .files = kInSeries});
    list.also("simulated", &Finding::simulated, &SimulatedMotion::joints, "",
              {.files = kInSeries, .same = "joint", .item = "simulated motion"});
    list.field(
        "grey_box", &Finding::grey_box,
        "What was learned without a name where the verdict is UNKNOWN, a list of :class:`GreyBox`.",
        {.files = kInBoth, .same = "where", .item = "grey box"});
    list.field("absorbed", &Finding::absorbed,
               "Effects that cannot be seen, a list of :class:`Absorbed`.");
    list.field("refused", &Finding::refused,
               "Effects that were refused, a list of :class:`Refusal`.");
    list.field(
        "candidates", &Finding::candidates,
        "All that was tried at the first step, best first; a list of :class:`CandidateScore`.");
    list.field("gain", &Finding::gain, "Of all causes together, on held-out data.",
               {.optional = true});
    list.field("next_experiment", &Finding::next_experiment,
               "A :class:`NextExperiment`, or None where none is known.");
    list.field("joints", &Finding::joints,
               "Held-out error of every joint, a list of :class:`JointGain`.");
    list.field(
        "drives", &Finding::drives,
        "Where commands lead and no torque was recorded: numbers of the description's drives "
        "that are refuted, those that move most first; a list of :class:`RefutedNumber`.",
        {.optional = true});
    list.field("simulated", &Finding::simulated,
               "Held-out motion, simulated before and after: a :class:`SimulatedMotion`.",
               {.optional = true});
    list.field("ball", &Finding::ball,
               "The ball's path, a :class:`BallSeries`; None where there is no ball.");
    list.custom("ball", "The ball's path, columns of equal length; null where there is no ball.",
                {.files = kInSeries});
    list.field("plots", &Finding::plots, "Evidence to draw, a list of :class:`EvidencePlot`.",
               {.files = kInSeries});
    list.field("noise", &Finding::noise,
               "Root mean square of the noise of each joint's filtered, decimated torque; of its "
               "position where no torque was recorded.",
               {.optional = true});
    list.field("lack_of_fit", &Finding::lack_of_fit,
               "χ² of the base model over its degrees of freedom; 1: noise alone.",
               {.key = "lack_of_fit.f", .optional = true});
    list.field("lack_of_fit_p", &Finding::lack_of_fit_p,
               "Chance of the best candidate's χ² by noise, times the number of candidates.",
               {.key = "lack_of_fit.p", .optional = true});
    list.also("preprocessing.filter_hz", &Finding::plan, &PreprocessPlan::filter_hz);
    list.also("preprocessing.decimated_to_hz", &Finding::plan, &PreprocessPlan::decimator,
              "Rate of the rows that are tested.", {.unit = "Hz"});
    list.also("preprocessing.quarantined", &Finding::data_report, &ReadReport::quarantined);
    list.also("preprocessing.extra_channels", &Finding::data_report, &ReadReport::extra_channels);
    list.also("preprocessing.notes", &Finding::data_report, &ReadReport::notes);
    list.field("notes", &Finding::notes, "What a reader should know, one sentence each.");
    list.field("seconds", &Finding::seconds, "In all.", {.unit = "s", .key = "summary.seconds"});
    list.field("interrupted", &Finding::interrupted,
               "It was stopped; what had been found is there.", {.key = "summary.interrupted"});
    list.in_memory("model", &Finding::model,
                   "The extended model: base parameters as fitted, and the causes.");
    list.in_memory(
        "parameters", &Finding::parameters,
        "The base parameters that go with the causes: a list of :class:`ParameterEstimate`, "
        "also by name.");
    list.in_memory("plan", &Finding::plan, "How the recordings were filtered.");
    list.in_memory("data_report", &Finding::data_report, "What reading the files brought up.");
  }
};

}  // namespace diffnea
