#pragma once
/// What a diagnosis says: plain data in the terms of `result.json` (docs/schema/diagnose.md).

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/recording/audit.hpp>
#include <diffnea/recording/trajectory.hpp>

namespace diffnea {

/// What a diagnosis comes to (docs/diagnosis.md).
enum class Verdict {
  kNamed,            ///< every cause has one name
  kClass,            ///< some cause cannot be told from its rivals with this recording
  kUnknown,          ///< something is left that no effect of the catalogue explains
  kNone,             ///< nothing is left to explain
  kNotIdentifiable,  ///< the recording cannot show what the model lacks
};

/// Names in result files.
template <>
struct EnumNames<Verdict> {
  /// All verdicts.
  static constexpr NamedValue<Verdict> list[] = {{Verdict::kNamed, "NAMED"},
                                                 {Verdict::kClass, "CLASS"},
                                                 {Verdict::kUnknown, "UNKNOWN"},
                                                 {Verdict::kNone, "NONE"},
                                                 {Verdict::kNotIdentifiable, "NOT_IDENTIFIABLE"}};
};

/// How much of the catalogue a diagnosis tried.
enum class Tried { kAll, kSome, kNothing };

/// Names in Python.
template <>
struct EnumNames<Tried> {
  /// All there are.
  static constexpr NamedValue<Tried> list[] = {
      {Tried::kAll, "all"}, {Tried::kSome, "some"}, {Tried::kNothing, "nothing"}};
};

/// Held-out error over the noise that a sentence mentions: 1.24 at most in 264 recordings that hide
/// nothing.
inline constexpr double kUneasy = 1.35;
/// Held-out error over the noise that no verdict passes over: 1.37 at most in 207 of 209 recordings
/// whose cause was named.
inline constexpr double kFarOff = 3.0;

/// One parameter of a cause with its uncertainty.
struct CauseParameter {
  std::string name;
  std::string unit;
  double value = 0.0;
  double std = std::numeric_limits<double>::quiet_NaN();
  double low = std::numeric_limits<double>::quiet_NaN();
  double high = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("CauseParameter", "One parameter of a cause.");
    list.field("name", &CauseParameter::name, "As the effect has it (ParameterInfo): ``coulomb``.");
    list.field("value", &CauseParameter::value, "Estimate, or what it is held at.");
    list.field("unit", &CauseParameter::unit,
               "SI, as effects write it: ``N*m*s/rad``; ``1``: none.");
    list.field("std", &CauseParameter::std, "Standard error; NaN: held, or open.");
    list.field("low", &CauseParameter::low, "Lower end of its 95 % interval; NaN as std.",
               {.key = "ci95[0]"});
    list.field("high", &CauseParameter::high, "Upper end of its 95 % interval; NaN as std.",
               {.key = "ci95[1]"});
  }
};

/// Another effect in the place of a cause.
struct Rival {
  std::string effect;
  std::string where;
  double delta_bic = 0.0;
  bool more_general = false;
  double stability = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Rival", "Another effect in the place of a cause.");
    list.field("effect", &Rival::effect, "Name, as of a cause.");
    list.field("where", &Rival::where, "Joint, pair of joints, ``tip``, ``base`` or ``all``.");
    list.field("delta_bic", &Rival::delta_bic, "How much worse the fit is with the rival instead.");
    list.field("more_general", &Rival::more_general,
               "Whether it has the cause as a special case: the simpler one is named unless it is "
               "better by far.");
    list.field("stability", &Rival::stability,
               "Share of random halves of the recording on which it is chosen; NaN: not asked.",
               {.optional = true});
  }
};

/// What one step (or all of them) gains on held-out data. Errors are of the filtered, decimated
/// torques, each joint's divided by its noise (of the ball's positions: by the camera's): 1 is
/// noise alone.
struct Gain {
  double before = 0.0;
  double after = 0.0;
  double noise_floor = 0.0;
  double explained_share = 0.0;
  double low = 0.0;
  double high = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Gain",
              "What causes gain on held-out data. Errors are of filtered, decimated torque, each "
              "joint's over its noise.");
    list.field("before", &Gain::before, "Root mean square without the cause.",
               {.key = "test_rmse_before"});
    list.field("after", &Gain::after, "Root mean square with it.", {.key = "test_rmse_after"});
    list.field("noise_floor", &Gain::noise_floor,
               "What no smooth function of the motion removes either.");
    list.field("explained_share", &Gain::explained_share,
               "Of the removable mean square; of one cause of a joint: of the whole mean square.");
    list.field(
        "low", &Gain::low,
        "Removed share of the mean square: lower end of the 95 % interval (block bootstrap).",
        {.key = "ci95[0]"});
    list.field("high", &Gain::high, "Its upper end.", {.key = "ci95[1]"});
  }
};

/// Share of the held-out error that all causes remove: a cause with less is no word in a sentence,
/// and worth no experiment.
inline constexpr double kWorthWords = 0.05;

/// An effect that the model lacks.
struct Cause {
  std::string effect;
  std::string where;
  Verdict verdict = Verdict::kNamed;
  std::vector<CauseParameter> parameters;
  double delta_bic = 0.0;
  double lm = 0.0;
  double visible_share = 0.0;
  double torque_share = 0.0;
  double stability = std::numeric_limits<double>::quiet_NaN();
  double share = std::numeric_limits<double>::quiet_NaN();
  std::vector<Rival> members;
  std::vector<Rival> rivals;
  Gain gain;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Cause", "An effect that the model lacks.");
    list.field("effect", &Cause::effect,
               "As ``diffnea effects`` lists it; ``residual``; or that of an own candidate.");
    list.field(
        "where", &Cause::where,
        "A joint, ``elbow,wrist``, ``tip``, ``base``, ``all``, ``ball``, ``string``, ``camera``.");
    list.field("verdict", &Cause::verdict,
               "``NAMED``; ``CLASS`` if ``members`` do as well; ``UNKNOWN``: a learned remainder.");
    list.field("parameters", &Cause::parameters,
               "All of the effect, those that are held included.");
    list.field("delta_bic", &Cause::delta_bic, "Of leaving it out.");
    list.field("lm", &Cause::lm,
               "Its share of χ², base refitted: twice the log-likelihood that it gains.");
    list.field("visible_share", &Cause::visible_share,
               "Of its torque: what the base parameters cannot take over.");
    list.field("torque_share", &Cause::torque_share,
               "Root mean square of its torque over that of its joint's torque.");
    list.field("stability", &Cause::stability,
               "Share of random halves of the recording on which it is chosen among itself and its "
               "rivals; NaN: not asked.",
               {.optional = true});
    list.field("share", &Cause::share,
               "Of the held-out error² that all causes remove, each joint's counting alike, what it "
               "removes beside those before it; each is the next that removes most. NaN: not asked.",
               {.optional = true});
    list.field("members", &Cause::members,
               "Its class without itself: effects that this recording cannot tell from it; a list "
               "of :class:`Rival`.",
               {.key = "class"});
    list.field("rivals", &Cause::rivals, "The next ones, a list of :class:`Rival`.");
    list.field("gain", &Cause::gain, "Of this cause alone, the others in place.",
               {.optional = true});
  }
};

/// What the grey box has learned at one joint where the verdict is kUnknown: the torque of the
/// effect `residual` (effects/residual.hpp) over the variables that the witness names. It is among
/// the causes as well, kUnknown: a remainder without a name, no physics.
struct GreyBox {
  std::string where;
  std::string unit;
  std::vector<std::string> variables;
  std::vector<std::string> units;
  int bumps = 0;
  double effective_parameters = 0.0;
  double bound = 0.0;
  double torque_rms = 0.0;
  double before = 0.0;
  double after = 0.0;
  std::vector<std::vector<double>> at;
  std::vector<double> torque;
  std::vector<double> std;

  template <class List>
  static constexpr void fields(List& list) {
    list.type(
        "GreyBox",
        "What was learned without a name at one joint, where no effect explains what is left: the "
        "torque of the\neffect ``residual`` over the variables of the witness. No physics.",
        {.files = kInResult});
    list.field("where", &GreyBox::where, "The joint.", {.files = kInBoth});
    list.field("unit", &GreyBox::unit, "Of its torque: ``N*m``, ``N``.");
    list.field("variables", &GreyBox::variables, "One or two channels, e.g. ``q_elbow``.",
               {.files = kInBoth});
    list.field("units", &GreyBox::units, "Of these.", {.files = kInSeries});
    list.field("bumps", &GreyBox::bumps, "Of its table.");
    list.field("effective_parameters", &GreyBox::effective_parameters,
               "That the fit spent on them, what ΔBIC counts.");
    list.field("bound", &GreyBox::bound, "Most that it gives: the most that was seen.",
               {.unit = "unit"});
    list.field("torque_rms", &GreyBox::torque_rms, "Its root mean square on held-out data.");
    list.field("before", &GreyBox::before, "RMS of the joint's held-out error without it.",
               {.unit = "unit"});
    list.field("after", &GreyBox::after, "RMS of that error with it.", {.unit = "unit"});
    list.field("at", &GreyBox::at, "Of each variable, values of the drawing's grid.",
               {.files = kInSeries});
    list.field("torque", &GreyBox::torque, "On the grid, the last variable fastest.",
               {.unit = "unit", .files = kInSeries});
    list.field("std", &GreyBox::std, "The same, of the posterior given its widths.",
               {.files = kInSeries});
  }
};

/// A candidate that could not be tested or was refused, and why.
struct Refusal {
  std::string effect;
  std::string where;
  std::string reason;
  double delta_bic = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Refusal", "A candidate that could not be tested, or was refused.");
    list.field("effect", &Refusal::effect, "Name, as of a cause.");
    list.field("where", &Refusal::where, "Place, as of a cause.");
    list.field("reason", &Refusal::reason, "Half a sentence: ``does not help on held-out data``.",
               {.optional = true});
    list.field("delta_bic", &Refusal::delta_bic,
               "What it gains on the fitted rows; 0: not tested, or not known.");
  }
};

/// One line of the table of candidates: at the first step, before anything was accepted.
struct CandidateScore {
  std::string effect;
  std::string where;
  double delta_bic = 0.0;
  double lm = 0.0;
  double visible_share = 0.0;
  std::vector<double> shape;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("CandidateScore", "A candidate before anything was accepted.");
    list.field("effect", &CandidateScore::effect, "Name, as of a cause.");
    list.field("where", &CandidateScore::where, "Place, as of a cause.");
    list.field("delta_bic", &CandidateScore::delta_bic,
               "Of adding it to the base alone; above 0 it is better.");
    list.field("lm", &CandidateScore::lm, "χ² that it removes, base refitted, to first order.");
    list.field("visible_share", &CandidateScore::visible_share,
               "Of its columns, what the base leaves; near 0: it cannot show.");
    list.field("shape", &CandidateScore::shape,
               "Its shape parameters where it scored best, as the search first tries them; empty: "
               "it has none, or is a ball's.",
               {.optional = true});
  }
};

/// What the residual depends on.
struct Witness {
  std::string where;
  std::vector<std::string> variables;
  double share = 0.0;
  double delta_bic = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Witness", "What the error that is left depends on.");
    list.field("where", &Witness::where, "Joint, or ``ball``.");
    list.field("variables", &Witness::variables,
               "Channel names as in the recording: ``q_joint2``, ``qd_joint2``.");
    list.field("share", &Witness::share, "Of the mean square of the joint's error.");
    list.field("delta_bic", &Witness::delta_bic, "Of a smooth function of them beside the causes.");
  }
};

/// An effect that this recording cannot show beside the base parameters.
struct Absorbed {
  std::string effect;
  std::string where;
  double visible_share = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Absorbed", "An effect that this recording cannot show beside the base parameters.");
    list.field("effect", &Absorbed::effect, "Name, as of a cause.");
    list.field("where", &Absorbed::where, "Place, as of a cause.");
    list.field("visible_share", &Absorbed::visible_share,
               "Of its columns, what the base leaves: below 0.01.");
  }
};

/// Held-out error of one joint through the steps [N·m] or [N], RMS over the rows in which it moves;
/// of joint `ball`: of its position along one axis [m].
struct JointGain {
  std::string joint;
  std::string unit;
  double torque_rms = 0.0;
  double base = 0.0;
  double extended = 0.0;
  double noise_floor = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("JointGain", "Root mean square of one joint's held-out error: of its torque [N·m] or [N]; where commands "
              "lead it and no torque was recorded, of its position [rad] or [m].");
    list.field("joint", &JointGain::joint, "Its name, or ``ball``.");
    list.field("unit", &JointGain::unit, "Of all four: ``N*m``, ``N``; of positions ``rad``, ``m``.");
    list.field("torque_rms", &JointGain::torque_rms,
               "Of the measured torque; of a position, about its mean.");
    list.field("base", &JointGain::base, "Of the base model, refitted as ``base`` allows.");
    list.field("extended", &JointGain::extended, "With all causes.");
    list.field("noise_floor", &JointGain::noise_floor,
               "Of the torque's or the encoder's noise; ``ball``: what nothing removes.");
  }
};

/// Residuals of one joint over the held-out rows, for plots; rows of several recordings one after
/// the other.
struct ResidualSeries {
  std::string joint;
  std::string unit;
  std::vector<double> time;
  std::vector<double> measured;
  std::vector<double> base;
  std::vector<double> extended;
  std::vector<double> q;
  std::vector<double> qd;
  std::vector<double> qdd;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ResidualSeries",
              "Torque of one joint over the held-out rows, filtered and decimated.",
              {.columns = true, .most_rows = 4000});
    list.field("joint", &ResidualSeries::joint, "Its name in the model.");
    list.field("unit", &ResidualSeries::unit, "Of the torques: ``N*m``, ``N``.");
    list.field("time", &ResidualSeries::time, "Of the recording.", {.unit = "s"});
    list.field("measured", &ResidualSeries::measured, "Torque, filtered and decimated.",
               {.unit = "unit"});
    list.field("base", &ResidualSeries::base, "The base model's prediction of it.");
    list.field("extended", &ResidualSeries::extended, "(M,) of the model with all causes.");
    list.field("q", &ResidualSeries::q, "Filtered position [rad] or [m].");
    list.field("qd", &ResidualSeries::qd, "Its velocity [rad/s] or [m/s].");
    list.field("qdd", &ResidualSeries::qdd, "Its acceleration [rad/s²] or [m/s²].");
  }
};

/// One joint's motion over held-out windows, as measured and as simulated by both models, and for
/// how long the simulations follow it. The models' last row of each window is NaN: there the next
/// one starts.
struct SimulatedSeries {
  std::string joint;
  std::string unit;
  double noise = std::numeric_limits<double>::quiet_NaN();
  double tolerance = std::numeric_limits<double>::quiet_NaN();
  double base_follows = std::numeric_limits<double>::quiet_NaN();
  double extended_follows = std::numeric_limits<double>::quiet_NaN();
  double base_rmse = std::numeric_limits<double>::quiet_NaN();
  double extended_rmse = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> time;
  std::vector<double> measured;
  std::vector<double> base;
  std::vector<double> extended;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("SimulatedSeries",
              "One joint's held-out motion, measured and simulated, and for how long a simulation "
              "follows it.",
              {.files = kInSeries, .columns = true});
    list.field("joint", &SimulatedSeries::joint, "Its name in the model.", {.files = kInBoth});
    list.field("unit", &SimulatedSeries::unit, "Of the position: ``rad``, ``m``.",
               {.files = kInBoth});
    list.field("noise", &SimulatedSeries::noise,
               "Standard deviation of its sensor's noise, quantisation included.",
               {.unit = "unit", .files = kInResult});
    list.field(
        "tolerance", &SimulatedSeries::tolerance,
        "Error within which a simulation follows: three times the noise, or 1 % of the range "
        "of the held-out motion, whichever is more.",
        {.unit = "unit", .files = kInResult});
    list.field("base_follows", &SimulatedSeries::base_follows,
               "How long the base model follows this joint; 0: not even for the shortest horizon.",
               {.unit = "s", .key = "follows.base", .files = kInResult});
    list.field("extended_follows", &SimulatedSeries::extended_follows,
               "The same of the extended model.",
               {.unit = "s", .key = "follows.extended", .files = kInResult});
    list.field("base_rmse", &SimulatedSeries::base_rmse,
               "Root mean square error over the windows that are drawn [unit]; NaN: none.",
               {.key = "rmse_base", .files = kInResult});
    list.field("extended_rmse", &SimulatedSeries::extended_rmse, "The same of the extended model.",
               {.key = "rmse_extended", .files = kInResult});
    list.field("time", &SimulatedSeries::time, "(M,) [s]; windows follow each other.");
    list.field("measured", &SimulatedSeries::measured, "Position.", {.unit = "unit"});
    list.field("base", &SimulatedSeries::base, "(M,) of the base model; NaN where a window ends.");
    list.field("extended", &SimulatedSeries::extended, "(M,) of the extended model; NaN likewise.");
  }
};

/// Errors of both models over windows of one length. Where a window falls apart, its error is no
/// more than that of a joint at rest in the middle of its motion.
struct SimulatedHorizon {
  double horizon = 0.0;
  int windows = 0;
  int base_apart = 0;
  int extended_apart = 0;
  double base = std::numeric_limits<double>::quiet_NaN();
  double extended = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> base_rmse;
  std::vector<double> extended_rmse;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("SimulatedHorizon",
              "Errors of simulated positions over held-out windows of one length.",
              {.files = kInResult});
    list.field("horizon", &SimulatedHorizon::horizon, "Length of the windows.", {.unit = "s"});
    list.field("windows", &SimulatedHorizon::windows, "Number of windows.");
    list.field(
        "base_apart", &SimulatedHorizon::base_apart,
        "Windows in which the base model's simulation falls apart: it blows up, or its error "
        "exceeds the joint's motion about its mean.",
        {.key = "apart.base"});
    list.field("extended_apart", &SimulatedHorizon::extended_apart,
               "The same of the extended model.", {.key = "apart.extended"});
    list.field(
        "base", &SimulatedHorizon::base,
        "Largest of all joints' errors over their tolerance, base model; NaN: not simulated.");
    list.field("extended", &SimulatedHorizon::extended, "The same of the extended model.");
    list.field("base_rmse", &SimulatedHorizon::base_rmse,
               "Root mean square error of each of ``joints``, base model.");
    list.field("extended_rmse", &SimulatedHorizon::extended_rmse, "The same, extended model.");
  }
};

/// A window in which a simulation falls apart.
struct ApartWindow {
  std::string model;
  std::string joint;
  int run = 0;
  double time = 0.0;
  double horizon = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ApartWindow", "A held-out window in which a simulation falls apart.",
              {.files = kInResult});
    list.field("model", &ApartWindow::model, "``base`` or ``extended``.");
    list.field("joint", &ApartWindow::joint, "The first that leaves the measured motion.");
    list.field("run", &ApartWindow::run, "Number of the held-out recording, from 0.");
    list.field("time", &ApartWindow::time, "When it leaves, of the recording.", {.unit = "s"});
    list.field("horizon", &ApartWindow::horizon, "Length of the window.", {.unit = "s"});
  }
};

/// Held-out motion simulated by both models over windows of growing length, each from an estimated
/// first state on, driven by the measured torque.
struct SimulatedMotion {
  double base_follows = std::numeric_limits<double>::quiet_NaN();
  double extended_follows = std::numeric_limits<double>::quiet_NaN();
  double window = 0.0;
  std::vector<SimulatedHorizon> horizons;
  std::vector<ApartWindow> apart;
  std::string reason;
  std::vector<SimulatedSeries> joints;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("SimulatedMotion",
              "Held-out motion simulated over windows of growing length: for how long a simulation "
              "follows the robot.");
    list.field("base_follows", &SimulatedMotion::base_follows,
               "How long the base model follows every joint within its tolerance; 0: not even for "
               "the shortest horizon; the longest horizon: at least so long.",
               {.unit = "s", .key = "follows.base"});
    list.field("extended_follows", &SimulatedMotion::extended_follows,
               "The same of the extended model.", {.unit = "s", .key = "follows.extended"});
    list.field("horizons", &SimulatedMotion::horizons,
               "By growing length, a list of :class:`SimulatedHorizon`.");
    list.field("apart", &SimulatedMotion::apart,
               "Windows that fall apart at the shortest horizon at which a model's do, a list of "
               ":class:`ApartWindow`.");
    list.field("window", &SimulatedMotion::window,
               "Length of the windows that are drawn: beyond what the base model follows.",
               {.unit = "s"});
    list.field("reason", &SimulatedMotion::reason, "Why there is none; empty if there is.",
               {.empty_is_null = true});
    list.field("joints", &SimulatedMotion::joints, "A list of :class:`SimulatedSeries`.");
  }
};

/// One line of a plot: means with their 95 % intervals; NaN where there is none.
struct EvidenceCurve {
  std::string model;
  std::vector<double> mean;
  std::vector<double> low;
  std::vector<double> high;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("EvidenceCurve", "One line of a plot: means with their 95 % intervals.",
              {.columns = true});
    list.field("model", &EvidenceCurve::model, "Whose error: ``base`` or ``extended``.",
               {.choices = "base|extended"});
    list.field("mean", &EvidenceCurve::mean,
               "Means, one for each ``x`` of the plot [``y_unit``]; NaN: none.");
    list.field("low", &EvidenceCurve::low, "Lower ends of their 95 % intervals.");
    list.field("high", &EvidenceCurve::high, "Upper ends of their 95 % intervals.");
  }
};

/// What an effect looks like in the torque error (measured − predicted) of held-out rows.
struct EvidencePlot {
  std::string kind;
  std::string joint;
  std::string x_name;
  std::string x_unit;
  std::string y_name;
  std::string y_unit;
  std::string effect;
  std::vector<double> x;
  std::vector<EvidenceCurve> curves;
  double mark = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("EvidencePlot", "What an effect looks like in the torque error of held-out rows.");
    list.field("kind", &EvidencePlot::kind,
               "``velocity``, ``position``, ``spectrum``, ``reversal``, ``correlation``, …");
    list.field("joint", &EvidencePlot::joint, "Whose error.");
    list.field("effect", &EvidencePlot::effect, "The cause that it stands for; empty: an overview.",
               {.empty_is_null = true});
    list.field("x_name", &EvidencePlot::x_name,
               "What x is, in words: ``velocity``, ``time from the reversal of the torque``.");
    list.field("x_unit", &EvidencePlot::x_unit, "Its unit.");
    list.field("y_name", &EvidencePlot::y_name,
               "What the curves are: ``error``, ``error along the motion``, ``correlation``.");
    list.field("y_unit", &EvidencePlot::y_unit, "``N*m``; ``1``: none.");
    list.field("mark", &EvidencePlot::mark, "A ripple's own cycles [``x_unit``]; NaN: none.");
    list.field("x", &EvidencePlot::x,
               "Where the curves have points: middles of bins, cycles, lags.");
    list.field("curves", &EvidencePlot::curves,
               "Of the base model; where there is a cause, of the extended one.");
  }
};

/// A cause and a rival of its class, and how clearly they differ.
struct ExperimentPair {
  std::string effect;
  std::string where;
  std::string rival;
  std::string rival_where;
  double delta_bic = 0.0;
  double expected_delta_bic = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ExperimentPair", "A cause and a rival of its class, and how clearly they differ.");
    list.field("effect", &ExperimentPair::effect, "The cause's effect.");
    list.field("where", &ExperimentPair::where, "Where it acts.");
    list.field("rival", &ExperimentPair::rival, "Effect of the rival.");
    list.field("rival_where", &ExperimentPair::rival_where, "Where that would act.");
    list.field("delta_bic", &ExperimentPair::delta_bic, "In this recording.");
    list.field("expected_delta_bic", &ExperimentPair::expected_delta_bic,
               "In the next one, if the cause is the cause.");
  }
};

/// Where RUN/ holds the motion.
inline const std::string kNextExperimentFile = "next_experiment.csv";

/// A motion that would tell the rivals apart.
struct NextExperiment {
  std::string sentence;
  std::vector<ExperimentPair> pairs;
  double expected_delta_bic = 0.0;
  std::string trajectory;
  Trajectory motion;

  /// Effect and rival of all pairs.
  std::vector<std::array<std::string, 2>> separates() const {
    std::vector<std::array<std::string, 2>> out;
    for (const ExperimentPair& pair : pairs) out.push_back({pair.effect, pair.rival});
    return out;
  }

  template <class List>
  static constexpr void fields(List& list) {
    list.type("NextExperiment", "A motion that would tell rivals apart.");
    list.field("sentence", &NextExperiment::sentence, "What to do, and what to expect of it.");
    list.derived("separates", &NextExperiment::separates,
                 "Effect and rival of all pairs, told apart or not.");
    list.field("pairs", &NextExperiment::pairs,
               "In question, a list of :class:`ExperimentPair`; told apart are those that expect "
               "10 or more.");
    list.field("expected_delta_bic", &NextExperiment::expected_delta_bic,
               "The smallest of the pairs that it tells apart.");
    list.field("trajectory", &NextExperiment::trajectory,
               "File beside the result; empty: no motion that was tried tells any pair apart.",
               {.empty_is_null = true});
    list.in_memory("motion", &NextExperiment::motion, "The :class:`Trajectory` to record.");
  }
};

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
