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
/// global. Robust losses and shape parameters (v₀, Stribeck velocity …) take one more pass for each
/// re-weighting or step.

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
  double objective = 0;  ///< of the last iteration, in units of χ²/2
};

/// What is fitted, by which loss, and when the fit stops.
struct IdentifyOptions {
  Loss loss = Loss::kInverse;
  Robust robust = Robust::kNone;
  FitChoice choice;
  PreprocessOptions preprocess;
  LinearFitOptions linear;
  TrajectoryOptions trajectory;
  BallFitOptions ball;            ///< where the model and the recordings have one
  int max_passes = 25;            ///< over the data, of robust losses and shape parameters
  double shape_tolerance = 1e-3;  ///< stop when no ln η, nor η in its unit, moves by more
  std::function<bool(const FitProgress&)> progress;
};

/// One fitted parameter.
struct ParameterEstimate {
  std::string name, unit;
  double value = 0.0;
  double std = 0.0;  ///< standard error; NaN if not identifiable
  double prior = 0.0;
  bool identifiable = false;
  bool fixed = false;
  bool at_bound =
      false;  ///< the consistent optimum lies on the boundary (zero friction, massless part)
};

/// Root mean square of one joint's torque error, four times over [N·m] or [N]; of joint `ball`: of
/// its position along one axis [m], with torque_rms of the position about its mean.
struct JointError {
  std::string joint, unit;
  double torque_rms = 0.0;     ///< of the measured torque, held-out set (training set without one)
  double train = 0.0;          ///< filtered, decimated series that was fitted
  double nominal_train = 0.0;  ///< the model before the fit
  double test = 0.0;           ///< held out; NaN without a test set
  double nominal_test = 0.0;
  double test_all = 0.0;  ///< samples at which the joint rests included
  double test_raw = 0.0;  ///< unfiltered torque; ball: with rows that the fit's path contradicts
};

/// Torque of one joint over time, for plots; rows of the filtered, decimated series.
struct TorqueSeries {
  std::string joint, unit;
  std::vector<double> time, measured, fitted, nominal;
  std::vector<double> velocity;  ///< low-passed like the torque; trajectory loss: empty
};

/// A torque constant that the fit corrected: recorded torques are `assumed` times the current, and
/// 1 + ε (torque_gain) times what they should be.
struct TorqueConstant {
  std::string joint, unit;
  double assumed = 0.0;  ///< of the recording's sidecar [N·m/A] or [N/A]
  double value = 0.0;    ///< assumed / (1 + ε)
  double std = 0.0;      ///< standard error; NaN if the gain could not be identified
};

/// How a fit went.
struct FitSummary {
  bool converged = false;
  bool interrupted = false;
  std::string termination;
  int iterations = 0;    ///< Newton steps of the last fit
  int passes = 0;        ///< over the data
  long rows = 0;         ///< of the recordings
  long fitted_rows = 0;  ///< torque samples in the factor
  double seconds = 0.0, seconds_fitting = 0.0;
};

/// How a note begins that a reader must not overlook; these come first.
inline constexpr const char* kWarning = "WARNING: ";

/// What a fit found: the model, its parameters with errors, and what it is worth.
struct IdentifyResult {
  Model model;  ///< the input with fitted values, effects and posterior
  std::vector<ParameterEstimate> parameters;
  std::vector<BaseParameter> base_parameters;
  /// Where the recording names one and a gain was fitted.
  std::vector<TorqueConstant> torque_constants;
  std::vector<JointError> errors;
  std::vector<std::string> boundary;  ///< links on the boundary of consistency
  double consistency_cost = 0.0;      ///< χ²/2 that consistency costs
  bool physically_consistent = false;
  PreprocessPlan plan;
  ReadReport data_report;
  std::vector<std::string>
      notes;  ///< what a reader should know: motionless joints, dropped segments …
  std::vector<TorqueSeries> train_series, test_series;
  std::optional<BallSeries> ball;  ///< where a ball was fitted
  FitSummary summary;
};

/// @param test  held-out recordings, may be null
/// @throws DataError, ModelError, FileError before any work starts where the input is at fault
IdentifyResult identify(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const IdentifyOptions& options = {});
/// The same from recordings in memory.
IdentifyResult identify(const Model& model, const std::vector<Recording>& train,
                        const std::vector<Recording>& test, const IdentifyOptions& options = {});

}  // namespace diffnea
