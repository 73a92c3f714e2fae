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

/// How much of the catalogue a diagnosis tried.
enum class Tried { kAll, kSome, kNothing };

/// Held-out error over the noise. Uneasy: 1.24 at most in 264 recordings that hide nothing. Far
/// off: no verdict passes over it; 1.37 at most in 207 of 209 recordings whose cause was named.
inline constexpr double kUneasy = 1.35, kFarOff = 3.0;

/// One parameter of a cause with its uncertainty.
struct CauseParameter {
  std::string name;    ///< as the effect has it (ParameterInfo): "coulomb"
  std::string unit;    ///< SI, as effects write it: "N*m*s/rad"; "1": none
  double value = 0.0;  ///< estimate, or what it is held at
  double std = std::numeric_limits<double>::quiet_NaN();   ///< standard error; NaN: held, or open
  double low = std::numeric_limits<double>::quiet_NaN();   ///< of its 95 % interval; NaN as std
  double high = std::numeric_limits<double>::quiet_NaN();  ///< of its 95 % interval; NaN as std
};

/// Another effect in the place of a cause.
struct Rival {
  std::string effect;      ///< name, as of a cause
  std::string where;       ///< place, as of a cause
  double delta_bic = 0.0;  ///< how much worse the fit is with the rival instead
};

/// What one step (or all of them) gains on held-out data. Errors are of the filtered, decimated
/// torques, each joint's divided by its noise (of the ball's positions: by the camera's): 1 is
/// noise alone.
struct Gain {
  double before = 0.0;       ///< root mean square without the cause
  double after = 0.0;        ///< root mean square with it
  double noise_floor = 0.0;  ///< what no smooth function of the motion removes either
  /// Of the removable mean square; of one cause of a joint: of the whole mean square.
  double explained_share = 0.0;
  double low = 0.0;   ///< 95 % interval of the removed share of the mean square (block bootstrap)
  double high = 0.0;  ///< its upper end
};

/// An effect that the model lacks.
struct Cause {
  std::string effect;  ///< as `diffnea effects` lists it; `residual`; or that of an own candidate
  std::string where;   ///< a joint, "elbow,wrist", "tip", "base", "all", "ball", "string", "camera"
  Verdict verdict = Verdict::kNamed;       ///< kNamed, kClass; kUnknown: effect `residual`
  std::vector<CauseParameter> parameters;  ///< all of the effect, those that are held included
  double delta_bic = 0.0;                  ///< of leaving it out
  double lm = 0.0;  ///< its share of χ², base refitted: twice the log-likelihood that it gains
  double visible_share = 0.0;  ///< of its torque (or path), what the base cannot take over
  double torque_share = 0.0;   ///< its torque's RMS over the measured torque's, at its joint
  std::vector<Rival> members;  ///< its equivalence class without itself: less than 10 worse
  std::vector<Rival> rivals;   ///< the next ones
  Gain gain;                   ///< of this cause alone, the others in place
};

/// What the grey box has learned at one joint where the verdict is kUnknown: the torque of the
/// effect `residual` (effects/residual.hpp) over the variables that the witness names. It is among
/// the causes as well, kUnknown: a remainder without a name, no physics.
struct GreyBox {
  std::string where;                    ///< joint
  std::string unit;                     ///< of its torque: "N*m", "N"
  std::vector<std::string> variables;   ///< channels: "q_joint2", "qd_joint2"
  std::vector<std::string> units;       ///< of these
  int bumps = 0;                        ///< of the table
  double effective_parameters = 0.0;    ///< that the fit spent on them, what ΔBIC counts
  double bound = 0.0;                   ///< most that it gives [unit]: the most that was seen
  double torque_rms = 0.0;              ///< of it on held-out data [unit]
  double before = 0.0;                  ///< RMS of the joint's held-out error without it [unit]
  double after = 0.0;                   ///< RMS of that error with it [unit]
  std::vector<std::vector<double>> at;  ///< of each variable, values of the drawing's grid
  std::vector<double> torque;           ///< on the grid, the last variable fastest [unit]
  std::vector<double> std;              ///< the same, of the posterior given its widths
};

/// A candidate that could not be tested or was refused, and why.
struct Refusal {
  std::string effect;      ///< name, as of a cause
  std::string where;       ///< place, as of a cause
  std::string reason;      ///< half a sentence: "does not help on held-out data"
  double delta_bic = 0.0;  ///< what it gains on the fitted rows; 0: not tested, or not known
};

/// One line of the table of candidates: at the first step, before anything was accepted.
struct CandidateScore {
  std::string effect;          ///< name, as of a cause
  std::string where;           ///< place, as of a cause
  double delta_bic = 0.0;      ///< of adding it to the base alone; above 0 it is better
  double lm = 0.0;             ///< χ² that it removes, base refitted, to first order
  double visible_share = 0.0;  ///< of its columns, what the base leaves; near 0: it cannot show
  std::vector<double> shape;   ///< its shape parameters where it scored best, as the search
                               ///< first tries them; empty: it has none, or is a ball's
};

/// What the residual depends on.
struct Witness {
  std::string where;  ///< joint, or `ball`
  std::vector<std::string>
      variables;           ///< channel names as in the recording: "q_joint2", "qd_joint2"
  double share = 0.0;      ///< of the joint's residual mean square
  double delta_bic = 0.0;  ///< of a smooth function of them beside the causes
};

/// An effect that this recording cannot show beside the base parameters.
struct Absorbed {
  std::string effect;          ///< name, as of a cause
  std::string where;           ///< place, as of a cause
  double visible_share = 0.0;  ///< of its columns, what the base leaves: below 0.01
};

/// Held-out error of one joint through the steps [N·m] or [N], RMS over the rows in which it moves;
/// of joint `ball`: of its position along one axis [m].
struct JointGain {
  std::string joint;         ///< its name, or `ball`
  std::string unit;          ///< of all four: "N*m", "N"; of `ball`: "m"
  double torque_rms = 0.0;   ///< of the measured torque; `ball`: of its position about its mean
  double base = 0.0;         ///< base model, refitted as `base` allows
  double extended = 0.0;     ///< with all causes
  double noise_floor = 0.0;  ///< of the torque's noise; `ball`: what nothing removes
};

/// Residuals of one joint over the held-out rows, for plots; rows of several recordings one after
/// the other.
struct ResidualSeries {
  std::string joint;             ///< its name in the model
  std::string unit;              ///< of the torques: "N*m", "N"
  std::vector<double> time;      ///< [s], of the recording
  std::vector<double> measured;  ///< torque, filtered and decimated [unit]
  std::vector<double> base;      ///< the base model's prediction of it
  std::vector<double> extended;  ///< the extended model's
  std::vector<double> q;         ///< filtered position [rad] or [m]
  std::vector<double> qd;        ///< its velocity [rad/s] or [m/s]
  std::vector<double> qdd;       ///< its acceleration [rad/s²] or [m/s²]
};

/// One joint's motion over held-out windows, as measured (filtered) and as simulated again by both
/// models. The models' last row of each window is NaN: there the next one starts.
struct SimulatedSeries {
  std::string joint;             ///< its name in the model
  std::string unit;              ///< of the position: "rad", "m"
  std::vector<double> time;      ///< [s], of the recording
  std::vector<double> measured;  ///< filtered position [unit]
  std::vector<double> base;      ///< by the base model [unit]
  std::vector<double> extended;  ///< by the extended model [unit]
  double base_rmse = 0.0;        ///< over the windows that both models finish [unit]; NaN: none
  double extended_rmse = 0.0;    ///< the same of the extended model
};

/// Held-out motion simulated again: each window from its measured state on (sim/replay.hpp).
struct SimulatedMotion {
  std::string driven_by;    ///< "controller" (its gains and qcmd_ are known) or "measured torque"
  double window = 0.0;      ///< [s]
  int windows = 0;          ///< tried; spread over the held-out rows
  int base_failed = 0;      ///< windows in which the simulation with the base model blew up
  int extended_failed = 0;  ///< the same of the extended model
  std::string reason;       ///< why there is none; empty
  std::vector<SimulatedSeries> joints;  ///< empty if there is none
};

/// One line of a plot: means with their 95 % intervals; NaN where there is none.
struct EvidenceCurve {
  std::string model;         ///< whose error: "base", "extended"
  std::vector<double> mean;  ///< at each EvidencePlot::x, in its y_unit
  std::vector<double> low;   ///< lower ends of the intervals
  std::vector<double> high;  ///< upper ends of the intervals
};

/// What an effect looks like in the torque error (measured − predicted) of held-out rows.
struct EvidencePlot {
  std::string kind;    ///< "velocity", "position", "spectrum", "reversal", "correlation", …
  std::string joint;   ///< whose error
  std::string x_name;  ///< what x is, in words: "velocity", "time from the reversal of the torque"
  std::string x_unit;  ///< "rad/s"
  std::string y_name;  ///< what the curves are: "error", "error along the motion", "correlation"
  std::string y_unit;  ///< "N*m"; "1": none
  std::string effect;  ///< the cause that it stands for; empty: an overview
  std::vector<double> x;  ///< where the curves have points: middles of bins, cycles, lags
  std::vector<EvidenceCurve> curves;  ///< base; where there is a cause, extended
  double mark = std::numeric_limits<double>::quiet_NaN();  ///< a ripple's own cycles; NaN: none
};

/// A cause and a rival of its class, and how clearly they differ.
struct ExperimentPair {
  std::string effect;               ///< the cause's
  std::string where;                ///< the cause's
  std::string rival;                ///< effect of the rival
  std::string rival_where;          ///< its place
  double delta_bic = 0.0;           ///< in this recording
  double expected_delta_bic = 0.0;  ///< in the next one, if the cause is the cause
};

/// Where RUN/ holds the motion.
inline const std::string kNextExperimentFile = "next_experiment.csv";

/// A motion that would tell the rivals apart.
struct NextExperiment {
  std::string sentence;               ///< what to do, and what to expect of it
  std::vector<ExperimentPair> pairs;  ///< in question; told apart are those that expect 10 or more
  double expected_delta_bic = 0.0;    ///< smallest of the pairs that it tells apart
  std::string trajectory;             ///< file in RUN/; empty: no motion that was tried tells any
  Trajectory motion;                  ///< what the file holds
};

/// What a diagnosis found: verdict, causes, what is left, and the model that has them.
struct Finding {
  Verdict verdict = Verdict::kNone;  ///< of arm and ball, the worse
  Tried tried = Tried::kAll;         ///< candidates there were; not in result.json
  std::string sentence;              ///< the verdict in words, with numbers; report/ writes it
  std::vector<Cause> causes;      ///< of joints, strongest first, `residual` last; then of the ball
  std::vector<Witness> witness;   ///< what the rest depends on, best first; empty: nothing found
  std::vector<GreyBox> grey_box;  ///< best first; where the verdict is kUnknown
  std::vector<Absorbed> absorbed;          ///< effects that this recording cannot show
  std::vector<Refusal> refused;            ///< candidates that were not tried, or do not help
  std::vector<CandidateScore> candidates;  ///< best first
  Gain gain;  ///< of all causes together; of the ball's if the arm lacks nothing
  std::vector<JointGain> joints;       ///< whose torque is known, then `ball`
  std::vector<ResidualSeries> series;  ///< of the same joints, without the ball
  std::vector<EvidencePlot> plots;     ///< curves that fit the causes, 24 at most; report/ adds them
  SimulatedMotion simulated;           ///< by the base and by the extended model
  std::optional<BallSeries> ball;      ///< held-out where there is a test recording
  std::vector<ChannelFault> audit;     ///< of the recordings, before any dynamics
  /// None: no cause has a class, or none could be planned; then a note may say why.
  std::optional<NextExperiment> next_experiment;
  double lack_of_fit = 0.0;  ///< χ² of the base model over its degrees of freedom; 1: noise
  /// Chance that noise gives some candidate as much χ² as it removes: the least one's, times the
  /// candidates and their starts (Bonferroni).
  double lack_of_fit_p = 1.0;
  /// RMS of the noise: of each known torque, filtered and decimated [N·m] or [N]; then of the
  /// ball's position along one axis [m].
  std::vector<double> noise;
  std::string held_out;                       ///< "test recording" or "time blocks"
  std::string base;                           ///< "refit", "prior", "fixed"
  Model model;                                ///< the extended model
  std::vector<ParameterEstimate> parameters;  ///< of its base
  PreprocessPlan plan;             ///< of the fitted recordings; dt = 0: no joint was looked at
  ReadReport data_report;          ///< of the fitted recordings
  std::vector<std::string> notes;  ///< what a reader should know, one sentence each
  double seconds = 0.0;            ///< in all [s]
  bool interrupted = false;        ///< the callback said so; the causes are those found until then
};

}  // namespace diffnea
