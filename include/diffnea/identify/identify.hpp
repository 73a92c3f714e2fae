#pragma once
/// Identification: from recordings of a robot to a physically consistent model with uncertainties.
///
///     const Model model = read_model("arm.urdf");
///     IdentifyOptions options;
///     const IdentifyResult result = identify(model, read_recordings("train.csv"),
///                                            read_recordings("test.csv"), options);
///     write_model(result.model, "fitted.json");
///
/// Inverse loss (paper, eq. 3): torques are linear in the inertial and most effect parameters. One
/// pass over the data factors [Y τ]; the consistent optimum follows from the factor alone and is
/// global. Robust losses, shape parameters (v₀, Stribeck velocity …) and friction by the
/// transmitted torque take one more pass for each re-weighting or step.

#include <limits>

#include <diffnea/core/fields.hpp>
#include <diffnea/core/options.hpp>
#include <diffnea/identify/ball_options.hpp>
#include <diffnea/identify/ball_series.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/motion/horizon.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// What is compared: torques, accelerations, or positions of simulated windows.
enum class Loss { kInverse, kForward, kMotion };
/// Names in options.
template <>
struct EnumNames<Loss> {
  /// All losses of the arm.
  static constexpr NamedValue<Loss> list[] = {
      {Loss::kInverse, "inverse"}, {Loss::kForward, "forward"}, {Loss::kMotion, "motion"}};
};

/// Weights of rows with large residuals (Holland, Welsch 1977).
enum class Robust { kNone, kHuber, kCauchy };
/// Names in options.
template <>
struct EnumNames<Robust> {
  /// All weights.
  static constexpr NamedValue<Robust> list[] = {
      {Robust::kNone, "none"}, {Robust::kHuber, "huber"}, {Robust::kCauchy, "cauchy"}};
};

/// Where a fit stands. A callback that returns false stops it; what was found is kept.
struct FitProgress {
  std::string stage;
  int iteration = 0;
  long rows = 0;
  double objective = 0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("FitProgress", "Where a fit stands.");
    list.field("stage", &FitProgress::stage, "What is being done: ``reading``, ``fitting``, …");
    list.field("iteration", &FitProgress::iteration, "Of the stage.");
    list.field("rows", &FitProgress::rows, "Rows read.");
    list.field("objective", &FitProgress::objective,
               "Of the last iteration [χ²/2]; of a ball: its σ [m]; 0: none yet.");
  }
};

/// What is fitted, by which loss, and when the fit stops.
struct IdentifyOptions {
  Loss loss = Loss::kInverse;     ///< of the arm; the ball's is in `ball`
  Robust robust = Robust::kNone;  ///< of the inverse and the forward loss
  FitChoice choice;               ///< parameters and effects that may move, and those that are held
  PreprocessOptions preprocess;   ///< filters and rates of the joints' channels
  LinearFitOptions linear;        ///< of the inverse and the forward loss
  MotionOptions motion;           ///< of the motion loss
  BallFitOptions ball;            ///< where the model and the recordings have one
  /// Over the data, of robust losses, of shape parameters and of effects that hang on the torque of
  /// the links; what follows the shapes gets five in any case. A fit that would need more has not
  /// converged.
  int max_passes = 25;
  double shape_tolerance = 1e-3;  ///< stop when no ln η, nor η in its unit, moves by more
  /// Called with every block that is read and every step; returns false: stop. May be empty.
  std::function<bool(const FitProgress&)> progress;

  /// Names and texts (core/options.hpp).
  template <class List>
  void options(List& list) {
    std::vector<std::string> losses = names_of<Loss>();
    losses.emplace_back("constrained");  // a ball's; the arm has no constraint to adhere to
    list.words(
        "--loss", "loss", losses, name_of(loss),
        [this](const std::string& word) {
          ball.loss = word == "constrained" ? BallLoss::kConstrained : BallLoss::kTrajectory;
          loss = word == "constrained" ? Loss::kInverse : value_of<Loss>(word, "loss");
        },
        "of torque (inverse), acceleration (forward), or simulated motion; constrained: of a "
        "ball's "
        "acceleration and its string, where otherwise its path is fitted");
    list.option("--robust", "robust", robust, "weights that outliers lose by");
    list.option("--fit", "fit", choice.fit,
                "what may move: inertia, armature, effects, string (of a ball: its length and "
                "attachment), shapes (of effects), kinematics (fixed transforms; kinematics@JOINT "
                "for one)",
                {.by_commas = true});
    list.option("--effects", "effects", choice.effects,
                "beyond those of the model: name, name@joint or name@joint,joint; "
                "payload@tip:run=1 acts in recording 1 alone (from 0, the held-out ones last); "
                "default: armature, viscous and Coulomb friction and an offset at every joint; "
                "with torque sensors behind the drive (torque side: link) the offset alone; of a "
                "ball on a string linear_drag, in free flight quadratic_drag",
                {.by_commas = true});
    list.option("--fix", "fix", choice.fix,
                "parameters to hold at the model's value: names, or patterns such as "
                "forearm.*; at another: NAME=VALUE");
    list.option(nullptr, "entropic_prior", linear.entropic_prior,
                "pull of every inertia to the model's [units of χ²/2], 0: none");
    list.option("--parameters", "parameters", linear.parameters,
                "of inertias: convex, or virtual (the paper's; the same optimum by a descent, for "
                "comparison)");
    list.option(nullptr, "physical", linear.physical,
                "False leaves inertias free (least squares), for comparison");
    list.option("--filter", "filter_hz", preprocess.filter_hz,
                "low-pass of the positions [Hz], 0: chosen", {.least = 0.0});
    list.option("--decimate", "decimate_to_hz", preprocess.decimate_to_hz,
                "rate of the fit [Hz], 0: chosen", {.least = 0.0});
    list.option("--horizon", "horizon", motion.horizon,
                "motion loss: longest simulated window [s], 0: whole runs, or until windows fall "
                "apart",
                {.least = 0.0});
    list.option("--ball-window", "ball_window", ball.window,
                "ball: length of a simulated window [s], at most; each starts from a state of its "
                "own, which is estimated",
                {.least = 0.0, .above = true});
    list.option("--lambda", "ball_lambda", ball.lambda,
                "constrained loss: weights of g, its first and its second derivative, each over "
                "its own noise",
                {.least = 0.0, .by_commas = true});
    list.option(nullptr, "max_passes", max_passes,
                "over the data, of robust losses and shape parameters");
    list.option(nullptr, "threads", motion.threads, "of the motion loss");
  }
};

/// One fitted parameter.
struct ParameterEstimate {
  std::string name;
  std::string unit;
  double value = 0.0;
  double std = 0.0;
  double prior = 0.0;
  bool identifiable = false;
  bool fixed = false;
  bool at_bound = false;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ParameterEstimate", "One fitted parameter.");
    list.field("name", &ParameterEstimate::name,
               "``forearm.mass``, ``elbow.coulomb_friction.coulomb``, ``string.length``.");
    list.field("value", &ParameterEstimate::value, "In the fitted model.");
    list.field("unit", &ParameterEstimate::unit,
               "SI, as effects write it: ``kg*m^2``, ``N*m*s/rad``; ``1``: none.");
    list.field("std", &ParameterEstimate::std,
               "Standard error; 0 where held, NaN if not identifiable.");
    list.field("prior", &ParameterEstimate::prior,
               "Before the fit: the model's, or what it was to be held at.");
    list.field("identifiable", &ParameterEstimate::identifiable,
               "The data alone know it; never if fixed.");
    list.field("fixed", &ParameterEstimate::fixed,
               "Held at ``prior``: asked for, or a note says why.");
    list.field("at_bound", &ParameterEstimate::at_bound,
               "The consistent optimum lies on the boundary (zero friction, massless part).");
  }
};

/// Root mean square of one joint's torque error, four times over [N·m] or [N]; of joint `ball`: of
/// its position along one axis [m], with torque_rms of the position about its mean. Motion loss:
/// of the joint's position [rad] or [m], without torque_rms. All NaN: its torque is not
/// known. Those of the held-out set NaN: it holds no row that counts (a note says why).
struct JointError {
  std::string joint;
  std::string unit;
  double torque_rms = 0.0;
  double train = 0.0;
  double nominal_train = 0.0;
  double test = 0.0;
  double nominal_test = 0.0;
  double test_all = 0.0;
  double test_raw = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("JointError",
              "Root mean square of one joint's torque error [N·m] or [N]; with the motion loss "
              "of its position's [rad] or [m]; of ``ball``: of its position's along one axis [m].");
    list.field("joint", &JointError::joint, "The joint's name, or ``ball``.");
    list.field("unit", &JointError::unit,
               "``N*m`` or ``N``; motion loss: ``rad`` or ``m``; of ``ball``: ``m``.");
    list.field("torque_rms", &JointError::torque_rms,
               "Of the measured torque: held out, else of the training data. Motion loss: NaN; "
               "of ``ball``: of its position about its mean.");
    list.field("train", &JointError::train, "Of the filtered, decimated series that was fitted.");
    list.field("nominal_train", &JointError::nominal_train, "The model before the fit.");
    list.field("test", &JointError::test, "Held out; NaN without a test set.");
    list.field("nominal_test", &JointError::nominal_test, "Held out, the model before the fit.");
    list.field("test_all", &JointError::test_all,
               "Held out, samples at which the joint rests included.");
    list.field("test_raw", &JointError::test_raw,
               "Held out, of the unfiltered torque. Motion loss: each window from its measured "
               "state; of ``ball``: with rows that the fit's path contradicts.");
  }
};

inline constexpr std::size_t kMaxSeriesRows = 4000;  ///< of each joint, see TorqueSeries

/// Torque of one joint over time, for plots; rows of the filtered, decimated series, the first
/// kMaxSeriesRows, those of several recordings one after the other. Motion loss: positions,
/// simulated window by window. All empty: its torque is not known.
struct TorqueSeries {
  std::string joint;
  std::string unit;
  std::vector<double> time;
  std::vector<double> measured;
  std::vector<double> fitted;
  std::vector<double> nominal;
  std::vector<double> velocity;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("TorqueSeries",
              "Torque of one joint over time, filtered and decimated; with the motion loss its "
              "position, simulated window by window.",
              {.columns = true});
    list.field("joint", &TorqueSeries::joint, "Its name in the model.");
    list.field("unit", &TorqueSeries::unit, "``N*m`` or ``N``; motion loss: ``rad`` or ``m``.");
    list.field("time", &TorqueSeries::time, "Of the recording.", {.unit = "s"});
    list.field("measured", &TorqueSeries::measured, "Low-passed; motion loss: as recorded.");
    list.field("fitted", &TorqueSeries::fitted, "(M,) of the model as fitted.");
    list.field("nominal", &TorqueSeries::nominal, "(M,) of the model before the fit.");
    list.field("velocity", &TorqueSeries::velocity,
               "(M,) of the joint [rad/s] or [m/s]; empty with the motion loss.",
               {.optional = true});
  }
};

/// How far the simulated positions of one joint are from the measured ones at one horizon, root
/// mean square [rad] or [m]: of the model that was fitted to windows of that length, and of the
/// model before the fit, each window from a first state that is estimated for that model.
struct HorizonError {
  double horizon = 0.0;
  std::string joint;
  std::string unit;
  double train = 0.0;
  double nominal_train = 0.0;
  double test = 0.0;
  double nominal_test = 0.0;
  int windows = 0;
  int apart = 0;
  int test_windows = 0;
  int test_apart = 0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("HorizonError",
              "How far simulated positions of a joint are from the measured ones at one horizon, "
              "root mean square.");
    list.field("horizon", &HorizonError::horizon, "Length of the simulated windows.",
               {.unit = "s"});
    list.field("joint", &HorizonError::joint, "Its name in the model.");
    list.field("unit", &HorizonError::unit, "``rad`` or ``m``.");
    list.field("train", &HorizonError::train, "Of the model fitted to windows of this length.");
    list.field("nominal_train", &HorizonError::nominal_train, "The model before the fit.");
    list.field("test", &HorizonError::test, "Held out; NaN without a test set.");
    list.field("nominal_test", &HorizonError::nominal_test, "Held out, the model before the fit.");
    list.field("windows", &HorizonError::windows, "Number of windows.");
    list.field("apart", &HorizonError::apart,
               "Windows that fall apart: the error is more than half of the joint's motion about "
               "its mean.");
    list.field("test_windows", &HorizonError::test_windows, "Number of windows held out.");
    list.field("test_apart", &HorizonError::test_apart, "Of these, windows that fall apart.");
  }
};

/// A torque constant that the fit corrected: recorded torques are `assumed` times the current, and
/// 1 + ε (torque_gain) times what they should be.
struct TorqueConstant {
  std::string joint;
  std::string unit;
  double assumed = 0.0;
  double value = 0.0;
  double std = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("TorqueConstant", "A torque constant that the fit corrected.");
    list.field("joint", &TorqueConstant::joint, "The joint's name.");
    list.field("unit", &TorqueConstant::unit, "``N*m/A`` or ``N/A``.");
    list.field("assumed", &TorqueConstant::assumed, "Of the recording's sidecar [N·m/A] or [N/A].");
    list.field("value", &TorqueConstant::value, "Assumed / (1 + gain_error).");
    list.field("std", &TorqueConstant::std,
               "Standard error; NaN if the gain could not be identified.");
  }
};

/// How a fit went.
struct FitSummary {
  bool converged = false;
  bool interrupted = false;
  std::string termination;
  int iterations = 0;
  int passes = 0;
  long rows = 0;
  long fitted_rows = 0;
  double seconds = 0.0;
  double seconds_fitting = 0.0;
  double horizon = std::numeric_limits<double>::quiet_NaN();
  double test_horizon = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("FitSummary", "How the fit went.");
    list.field("converged", &FitSummary::converged,
               "It reached its stop rule; of arm and ball, both did.");
    list.field("interrupted", &FitSummary::interrupted,
               "The callback said so; the result is of what had been done.");
    list.field("termination", &FitSummary::termination, "Why it ended, in words.",
               {.optional = true});
    list.field("iterations", &FitSummary::iterations, "Newton steps of the last fit.");
    list.field("passes", &FitSummary::passes, "Over the data.");
    list.in_memory("rows", &FitSummary::rows, "Of the recordings.");
    list.in_memory("fitted_rows", &FitSummary::fitted_rows,
                   "Torque samples in the factor (or positions), and rows of the ball.");
    list.field("seconds", &FitSummary::seconds, "In all.", {.unit = "s"});
    list.field("seconds_fitting", &FitSummary::seconds_fitting,
               "Of these, before the errors are computed [s]; reading counts.");
    list.field("horizon", &FitSummary::horizon,
               "Motion loss: longest windows that the simulation follows; NaN with other losses.",
               {.unit = "s"});
    list.field("test_horizon", &FitSummary::test_horizon,
               "The longest of these that held-out recordings have; NaN without.",
               {.unit = "s", .optional = true});
  }
};

/// How a note begins that a reader must not overlook; these come first.
inline constexpr const char* kWarning = "WARNING: ";

/// What a fit found: the model, its parameters with errors, and what it is worth.
struct IdentifyResult {
  Model model;
  std::vector<ParameterEstimate> parameters;
  std::vector<BaseParameter> base_parameters;
  std::vector<TorqueConstant> torque_constants;
  std::vector<JointError> errors;
  std::vector<HorizonError> horizons;
  std::vector<std::string> boundary;
  double consistency_cost = 0.0;
  bool physically_consistent = false;
  PreprocessPlan plan;
  ReadReport data_report;
  std::vector<std::string> notes;
  std::vector<TorqueSeries> train_series;
  std::vector<TorqueSeries> test_series;
  std::optional<BallSeries> ball;
  FitSummary summary;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("IdentifyResult", "A fit: the model with uncertainties, and how well it predicts.",
              {.files = kInResult});
    list.also("model", &IdentifyResult::model, &Model::name, "Name of the robot.",
              {.files = kInBoth, .optional = true});
    list.field("physically_consistent", &IdentifyResult::physically_consistent,
               "Every link is one that some distribution of mass can be.");
    list.field("parameters", &IdentifyResult::parameters,
               "The fitted parameters: a list of :class:`ParameterEstimate`, also by name; "
               "``.to_frame()``.");
    list.custom("effects",
                "Every effect of the fitted model: ``effect``, ``where`` and ``parameters``, each "
                "with ``name``, ``value``, ``unit`` and ``std``.");
    list.derived(
        "rank", [](const IdentifyResult& fit) { return fit.base_parameters.size(); },
        "Number of combinations that the data determine.");
    list.custom("base_parameters",
                "These combinations: ``expression``, ``value`` and ``std`` in SI units, ``terms`` "
                "(``parameter``, ``coefficient``).");
    list.field("torque_constants", &IdentifyResult::torque_constants,
               "Torque constants where a gain was fitted and the recording names one, a list of "
               ":class:`TorqueConstant`.");
    list.custom("rmse",
                "Per joint, root mean square torque error in ``units``: ``train``, "
                "``nominal_train`` (the model before the fit), ``test``, ``nominal_test``, "
                "``test_all`` (samples at which the joint rests included, which the others leave "
                "out), ``test_raw`` (against the unfiltered torque), ``torque_rms`` (of the "
                "held-out torque, or of the training data without one), and ``relative``: ``of`` "
                "(``test`` or ``train``), ``fitted`` and ``nominal`` as shares of ``torque_rms``.");
    list.field(
        "horizons", &IdentifyResult::horizons,
        "Motion loss: error over horizon, a list of :class:`HorizonError`; otherwise empty.");
    list.field("train_series", &IdentifyResult::train_series,
               "Measured and predicted torque, a list of :class:`TorqueSeries`.",
               {.key = "train", .files = kInSeries});
    list.field("test_series", &IdentifyResult::test_series, "The same, held out.",
               {.key = "test", .files = kInSeries});
    list.field("ball", &IdentifyResult::ball,
               "The ball's path, a :class:`BallSeries`; None where none was fitted.");
    list.custom("ball", "The ball's path, columns of equal length; null where none was fitted.",
                {.files = kInSeries});
    list.field("boundary", &IdentifyResult::boundary,
               "Links on the boundary of physical consistency.");
    list.field("consistency_cost", &IdentifyResult::consistency_cost, "What consistency costs.",
               {.unit = "χ²/2"});
    list.also("preprocessing.filter_hz", &IdentifyResult::plan, &PreprocessPlan::filter_hz);
    list.also("preprocessing.decimated_to_hz", &IdentifyResult::plan, &PreprocessPlan::decimator,
              "Rate of the rows that are fitted.", {.unit = "Hz"});
    list.also("preprocessing.period", &IdentifyResult::plan, &PreprocessPlan::dt);
    list.also("preprocessing.rows", &IdentifyResult::summary, &FitSummary::rows);
    list.also("preprocessing.fitted_rows", &IdentifyResult::summary, &FitSummary::fitted_rows);
    list.also("preprocessing.quarantined", &IdentifyResult::data_report, &ReadReport::quarantined);
    list.also("preprocessing.quarantined_rows", &IdentifyResult::data_report,
              &ReadReport::quarantined_rows);
    list.also("preprocessing.extra_channels", &IdentifyResult::data_report,
              &ReadReport::extra_channels);
    list.also("preprocessing.notes", &IdentifyResult::data_report, &ReadReport::notes);
    list.also("preprocessing.timing_jitter", &IdentifyResult::plan, &PreprocessPlan::timing_jitter);
    list.field("notes", &IdentifyResult::notes, "What a reader should know, one sentence each.");
    list.field("summary", &IdentifyResult::summary, "How the fit went.");
    list.in_memory("model", &IdentifyResult::model,
                   "The model with fitted values, effects and posterior.");
    list.in_memory("base_parameters", &IdentifyResult::base_parameters,
                   "Combinations that the data determine, a list of :class:`BaseParameter`.");
    list.in_memory("errors", &IdentifyResult::errors,
                   "Torque error of every joint, a list of :class:`JointError`.");
    list.in_memory("plan", &IdentifyResult::plan, "How the recordings were filtered.");
    list.in_memory("data_report", &IdentifyResult::data_report,
                   "What reading the files brought up.");
  }
};

/// @param test  held-out recordings, may be null
/// @throws DataError, ModelError, FileError before any work starts where the input is at fault
IdentifyResult identify(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const IdentifyOptions& options = {});
/// The same from recordings in memory.
IdentifyResult identify(const Model& model, const std::vector<Recording>& train,
                        const std::vector<Recording>& test, const IdentifyOptions& options = {});

}  // namespace diffnea
