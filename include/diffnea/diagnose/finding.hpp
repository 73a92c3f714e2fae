#pragma once
/// What a diagnosis says: plain data in the terms of `result.json` (docs/schema/diagnose.md).

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

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

/// "NAMED", "CLASS", "UNKNOWN", "NONE", "NOT_IDENTIFIABLE".
const char* name_of(Verdict verdict);
/// @throws ModelError naming the choices
Verdict verdict_from(const std::string& name);

/// One parameter of a cause with its uncertainty.
struct CauseParameter {
  std::string name, unit;
  double value = 0.0;
  double std = std::numeric_limits<double>::quiet_NaN();
  double low = std::numeric_limits<double>::quiet_NaN();  ///< 95 % interval
  double high = std::numeric_limits<double>::quiet_NaN();
};

/// Another effect in the place of a cause.
struct Rival {
  std::string effect, where;
  double delta_bic = 0.0;  ///< how much worse the fit is with the rival instead
};

/// What one step (or all of them) gains on held-out data. Errors are of the filtered, decimated
/// torques, each joint's divided by its noise: 1 is noise alone.
struct Gain {
  double before = 0.0, after = 0.0;  ///< root mean square without and with the cause
  double noise_floor = 0.0;          ///< what no smooth function of the motion removes either
  double explained_share = 0.0;      ///< of the removable mean square
  double low = 0.0,
         high = 0.0;  ///< 95 % interval of the removed share of the mean square (block bootstrap)
};

/// An effect that the model lacks.
struct Cause {
  std::string effect, where;
  Verdict verdict = Verdict::kNamed;  ///< kNamed, kClass; kUnknown: effect `residual`
  std::vector<CauseParameter> parameters;
  double delta_bic = 0.0;  ///< of leaving it out
  double lm = 0.0;  ///< its share of χ², base refitted: twice the log-likelihood that it gains
  double visible_share = 0.0;
  double torque_share = 0.0;   ///< its torque's RMS over the measured torque's, at its joint
  std::vector<Rival> members;  ///< its equivalence class without itself: less than 10 worse
  std::vector<Rival> rivals;   ///< the next ones
  Gain gain;                   ///< of this cause alone, the others in place
};

/// What the grey box has learned at one joint where the verdict is kUnknown: the torque of the
/// effect `residual` (effects/residual.hpp) over the variables that the witness names. It is among
/// the causes as well, kUnknown: a remainder without a name, no physics.
struct GreyBox {
  std::string where, unit;              ///< joint, unit of its torque
  std::vector<std::string> variables;   ///< channels: "q_joint2", "qd_joint2"
  std::vector<std::string> units;       ///< of these
  int bumps = 0;                        ///< of the table
  double effective_parameters = 0.0;    ///< that the fit spent on them, what ΔBIC counts
  double bound = 0.0;                   ///< most that it gives [unit]: the most that was seen
  double torque_rms = 0.0;              ///< of it on held-out data [unit]
  double before = 0.0, after = 0.0;     ///< RMS of the joint's held-out error without, with [unit]
  std::vector<std::vector<double>> at;  ///< of each variable, values of the drawing's grid
  std::vector<double> torque;           ///< on the grid, the last variable fastest [unit]
  std::vector<double> std;              ///< the same, of the posterior given its widths
};

/// A candidate that could not be tested or was refused, and why.
struct Refusal {
  std::string effect, where, reason;
  double delta_bic = 0.0;
};

/// One line of the table of candidates: at the first step, before anything was accepted.
struct CandidateScore {
  std::string effect, where;
  double delta_bic = 0.0;
  double lm = 0.0;
  double visible_share = 0.0;
  std::vector<double> shape;  ///< values of the searched shape parameters, best of the grid
};

/// What the residual depends on.
struct Witness {
  std::string where;
  std::vector<std::string>
      variables;       ///< channel names as in the recording: "q_joint2", "qd_joint2"
  double share = 0.0;  ///< of the joint's residual mean square
  double delta_bic = 0.0;
};

/// An effect that this recording cannot show beside the base parameters.
struct Absorbed {
  std::string effect, where;
  double visible_share = 0.0;
};

/// Held-out error of one joint through the steps [N·m] or [N].
struct JointGain {
  std::string joint, unit;
  double torque_rms = 0.0;
  double base = 0.0;      ///< base model, refitted as `base` allows
  double extended = 0.0;  ///< with all causes
  double noise_floor = 0.0;
};

/// Residuals of one joint over the held-out rows, for plots.
struct ResidualSeries {
  std::string joint, unit;
  std::vector<double> time, measured, base, extended;  ///< torque; the two models' predictions
  std::vector<double> q, qd, qdd;
};

/// One joint's motion over held-out windows, as measured (filtered) and as simulated again by both
/// models. The models' last row of each window is NaN: there the next one starts.
struct SimulatedSeries {
  std::string joint, unit;                             ///< of the position
  std::vector<double> time, measured, base, extended;  ///< [s], [unit]
  double base_rmse = 0.0, extended_rmse = 0.0;         ///< over the windows that both models finish
};

/// Held-out motion simulated again: each window from its measured state on (sim/replay.hpp).
struct SimulatedMotion {
  std::string driven_by;  ///< "controller" (its gains and qcmd_ are known) or "measured torque"
  double window = 0.0;    ///< [s]
  int windows = 0;        ///< tried; spread over the held-out rows
  int base_failed = 0, extended_failed = 0;  ///< in which the simulation blew up
  std::string reason;                        ///< why there is none; empty
  std::vector<SimulatedSeries> joints;       ///< empty if there is none
};

/// One line of a plot: means with their 95 % intervals; NaN where there is none.
struct EvidenceCurve {
  std::string model;  ///< whose error: "base", "extended"
  std::vector<double> mean, low, high;
};

/// What an effect looks like in the torque error (measured − predicted) of held-out rows.
struct EvidencePlot {
  std::string kind;   ///< "velocity", "position", "spectrum", "reversal", "correlation", …
  std::string joint;  ///< whose error
  std::string x_name, x_unit, y_name, y_unit;
  std::string effect;  ///< the cause that it stands for; empty: an overview
  std::vector<double> x;
  std::vector<EvidenceCurve> curves;
  double mark = std::numeric_limits<double>::quiet_NaN();  ///< the cause's own x (cycles, delay)
};

/// A cause and a rival of its class, and how clearly they differ.
struct ExperimentPair {
  std::string effect, where, rival, rival_where;
  double delta_bic = 0.0;           ///< in this recording
  double expected_delta_bic = 0.0;  ///< in the next one, if the cause is the cause
};

/// Where RUN/ holds the motion.
inline const std::string kNextExperimentFile = "next_experiment.csv";

/// A motion that would tell the rivals apart.
struct NextExperiment {
  std::string sentence;  ///< what to do, and what to expect of it
  std::vector<ExperimentPair> pairs;
  double expected_delta_bic = 0.0;  ///< smallest of the pairs that it tells apart
  std::string trajectory;           ///< file in RUN/; empty: no motion that was tried tells any
  Trajectory motion;                ///< what the file holds
};

/// What a diagnosis found: verdict, causes, what is left, and the model that has them.
struct Finding {
  Verdict verdict = Verdict::kNone;
  std::string sentence;
  std::vector<Cause> causes;
  std::vector<Witness> witness;
  std::vector<GreyBox> grey_box;  ///< best first; where the verdict is kUnknown
  std::vector<Absorbed> absorbed;
  std::vector<Refusal> refused;
  std::vector<CandidateScore> candidates;  ///< best first
  Gain gain;                               ///< of all causes together
  std::vector<JointGain> joints;
  std::vector<ResidualSeries> series;
  std::vector<EvidencePlot> plots;
  SimulatedMotion simulated;
  std::optional<BallSeries> ball;   ///< held-out where there is a test recording
  std::vector<ChannelFault> audit;  ///< of the recordings, before any dynamics
  std::optional<NextExperiment> next_experiment;
  double lack_of_fit = 0.0;    ///< F of the base model against the saturated one
  double lack_of_fit_p = 1.0;  ///< its p-value
  std::vector<double> noise;   ///< per joint, of the filtered, decimated torque [N·m] or [N]
  std::string held_out;        ///< "test recording" or "time blocks"
  std::string base;            ///< "refit", "prior", "fixed"
  Model model;                 ///< the extended model
  std::vector<ParameterEstimate> parameters;  ///< of its base
  PreprocessPlan plan;
  ReadReport data_report;
  std::vector<std::string> notes;
  double seconds = 0.0;
  bool interrupted = false;
};

}  // namespace diffnea
