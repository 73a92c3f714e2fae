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

#include <diffnea/identify/ball_options.hpp>
#include <diffnea/identify/ball_series.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/identify/trajectory_fit.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// What is compared: torques, accelerations, or positions of simulated windows.
enum class Loss { kInverse, kForward, kTrajectory };
/// Weights of rows with large residuals (Holland, Welsch 1977).
enum class Robust { kNone, kHuber, kCauchy };

/// Where a fit stands. A callback that returns false stops it; what was found is kept.
struct FitProgress {
  std::string stage;     ///< "reading", "fitting", …
  int iteration = 0;     ///< of the stage
  long rows = 0;         ///< rows read
  double objective = 0;  ///< of the last iteration [χ²/2]; of a ball: its σ [m]; 0: none yet
};

/// What is fitted, by which loss, and when the fit stops.
struct IdentifyOptions {
  Loss loss = Loss::kInverse;     ///< of the arm; the ball's is in `ball`
  Robust robust = Robust::kNone;  ///< of the inverse and the forward loss
  FitChoice choice;               ///< parameters and effects that may move, and those that are held
  PreprocessOptions preprocess;   ///< filters and rates of the joints' channels
  LinearFitOptions linear;        ///< of the inverse and the forward loss
  TrajectoryOptions trajectory;   ///< of the trajectory loss
  BallFitOptions ball;            ///< where the model and the recordings have one
  /// Over the data, of robust losses, of shape parameters and of effects that hang on the torque of
  /// the links; what follows the shapes gets five in any case. A fit that would need more has not
  /// converged.
  int max_passes = 25;
  double shape_tolerance = 1e-3;  ///< stop when no ln η, nor η in its unit, moves by more
  /// Called with every block that is read and every step; returns false: stop. May be empty.
  std::function<bool(const FitProgress&)> progress;
};

/// One fitted parameter.
struct ParameterEstimate {
  std::string name;           ///< "forearm.mass", "elbow.coulomb_friction.coulomb", "string.length"
  std::string unit;           ///< SI, as effects write it: "kg*m^2", "N*m*s/rad"; "1": none
  double value = 0.0;         ///< in the fitted model
  double std = 0.0;           ///< standard error; NaN if not identifiable, 0 if fixed
  double prior = 0.0;         ///< before the fit: the model's, or what it was to be held at
  bool identifiable = false;  ///< the data alone know it; never if fixed
  bool fixed = false;         ///< held at `prior`: asked for, or a note says why
  bool at_bound =
      false;  ///< the consistent optimum lies on the boundary (zero friction, massless part)
};

/// Root mean square of one joint's torque error, four times over [N·m] or [N]; of joint `ball`: of
/// its position along one axis [m], with torque_rms of the position about its mean. Trajectory
/// loss: of the joint's position [rad] or [m], without torque_rms. All NaN: its torque is not
/// known. Those of the held-out set NaN: it holds no row that counts (a note says why).
struct JointError {
  std::string joint;           ///< its name, or `ball`
  std::string unit;            ///< "N*m", "N"; trajectory loss: "rad", "m"; of `ball`: "m"
  double torque_rms = 0.0;     ///< of the measured torque, held-out set (training set without one)
  double train = 0.0;          ///< filtered, decimated series that was fitted
  double nominal_train = 0.0;  ///< the model before the fit
  double test = 0.0;           ///< held out; NaN without a test set
  double nominal_test = 0.0;   ///< held out, the model before the fit
  double test_all = 0.0;       ///< samples at which the joint rests included
  /// Unfiltered torque; trajectory loss: each window from its measured state; ball: with rows that
  /// the fit's path contradicts.
  double test_raw = 0.0;
};

inline constexpr std::size_t kMaxSeriesRows = 4000;  ///< of each joint, see TorqueSeries

/// Torque of one joint over time, for plots; rows of the filtered, decimated series, the first
/// kMaxSeriesRows, those of several recordings one after the other. Trajectory loss: positions,
/// simulated window by window. All empty: its torque is not known.
struct TorqueSeries {
  std::string joint;             ///< its name in the model
  std::string unit;              ///< "N*m", "N"; trajectory loss: "rad", "m"
  std::vector<double> time;      ///< [s], of the recording
  std::vector<double> measured;  ///< low-passed; trajectory loss: as recorded
  std::vector<double> fitted;    ///< by the fitted model
  std::vector<double> nominal;   ///< by the model before the fit
  std::vector<double> velocity;  ///< low-passed like the torque; trajectory loss: empty
};

/// A torque constant that the fit corrected: recorded torques are `assumed` times the current, and
/// 1 + ε (torque_gain) times what they should be.
struct TorqueConstant {
  std::string joint;     ///< whose drive
  std::string unit;      ///< "N*m/A", "N/A"
  double assumed = 0.0;  ///< of the recording's sidecar [N·m/A] or [N/A]
  double value = 0.0;    ///< assumed / (1 + ε)
  double std = 0.0;      ///< standard error; NaN if the gain could not be identified
};

/// How a fit went.
struct FitSummary {
  bool converged = false;    ///< it reached its stop rule; of arm and ball, both did
  bool interrupted = false;  ///< the callback said so; the result is of what had been done
  std::string termination;   ///< why it ended, in words
  int iterations = 0;        ///< Newton steps of the last fit
  int passes = 0;            ///< over the data
  long rows = 0;             ///< of the recordings
  long fitted_rows = 0;      ///< torque samples in the factor (or positions), and rows of the ball
  double seconds = 0.0;      ///< in all [s]
  double seconds_fitting = 0.0;  ///< of these, before the errors are computed [s]; reading counts
};

/// How a note begins that a reader must not overlook; these come first.
inline constexpr const char* kWarning = "WARNING: ";

/// What a fit found: the model, its parameters with errors, and what it is worth.
struct IdentifyResult {
  Model model;  ///< the input with fitted values, effects and posterior
  std::vector<ParameterEstimate> parameters;   ///< of the arm, fixed ones included; then the ball's
  std::vector<BaseParameter> base_parameters;  ///< of the arm; trajectory loss: empty
  /// Where the recording names one and a gain was fitted.
  std::vector<TorqueConstant> torque_constants;
  std::vector<JointError> errors;      ///< one a joint, then `ball` where one was fitted
  std::vector<std::string> boundary;   ///< links on the boundary of consistency
  double consistency_cost = 0.0;       ///< χ²/2 that consistency costs
  bool physically_consistent = false;  ///< inertias were kept to those that a body can have
  PreprocessPlan plan;                 ///< of the training recordings; dt = 0: no arm was fitted
  ReadReport data_report;              ///< of the training recordings
  std::vector<std::string>
      notes;  ///< what a reader should know: motionless joints, dropped segments …
  std::vector<TorqueSeries> train_series;  ///< of the training recordings, one a joint
  std::vector<TorqueSeries> test_series;   ///< of the held-out ones; empty without
  std::optional<BallSeries> ball;          ///< where a ball was fitted
  FitSummary summary;                      ///< of arm and ball together
};

/// @param test  held-out recordings, may be null
/// @throws DataError, ModelError, FileError before any work starts where the input is at fault
IdentifyResult identify(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const IdentifyOptions& options = {});
/// The same from recordings in memory.
IdentifyResult identify(const Model& model, const std::vector<Recording>& train,
                        const std::vector<Recording>& test, const IdentifyOptions& options = {});

}  // namespace diffnea
