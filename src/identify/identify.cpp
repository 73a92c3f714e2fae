#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>

#include <diffnea/core/error.hpp>

#include "identify/ball_identify.hpp"
#include "identify/ball_pull.hpp"
#include "identify/constraint_geometry.hpp"
#include "identify/drives.hpp"
#include "identify/passes.hpp"

namespace diffnea {

namespace {

const std::string kBall = "ball";

/// What a reader must not overlook: positions in degrees, a model that was wrong before, a fit that
/// explains little or made things worse.
void add_warnings(const Model& model, const RecordingSource& train, const RecordingSource* test,
                  IdentifyResult& result) {
  std::vector<std::string> first;
  for (const RecordingSource* source : {&train, test})
    if (source != nullptr)
      for (const ChannelWarning& w : source->warnings())
        first.push_back((source == test ? "held-out data: " : "") + w.joint + ": " + w.text);
  for (const ModelIssue& issue : check_model(model))
    first.push_back("the model before the fit looks wrong: " + issue.link + ": " + issue.text);
  // Windows that fall apart are a finding of their own.
  const bool apart = !result.horizons.empty() && result.horizons.back().test_apart > 0;
  for (const JointError& e : result.errors) {
    if (e.train > 1.02 * e.nominal_train)
      first.push_back(e.joint + " is reproduced worse than by the model before the fit (" +
                      format_number(e.train) + " against " + format_number(e.nominal_train) + " " +
                      e.unit +
                      "): look for bad stretches of data, or for an effect that the fit lacks");
    else if (!apart && e.test > 2.0 * e.nominal_test)
      first.push_back(
          e.joint + " is reproduced worse on held-out data than by the model before the fit (" +
          format_number(e.test) + " against " + format_number(e.nominal_test) + " " + e.unit +
          "): were both recorded with the same signs, units and load? Else the fit has "
          "taken too much from too little motion");
    // Of the rows that torque_rms is of: the fit's where no held-out row counts.
    const double error = std::isnan(e.test) ? e.train : e.test;
    if (e.torque_rms > 0.0 && error > 0.8 * e.torque_rms && e.joint != kBall)
      first.push_back(
          e.joint +
          ": the fit explains little of the measured torque; check its sign, its unit, the "
          "order of columns, and which effects are fitted");
  }
  for (std::string& note : first) note.insert(0, kWarning);
  result.notes.insert(result.notes.begin(), first.begin(), first.end());
}

/// What there is of a ball to fit.
struct BallPart {
  std::vector<Recording> train, test;
  bool alone = false;  ///< no torque was measured: the joints' motion is an input
};

BallPart ball_part(const Model& model, const RecordingSource& train, const RecordingSource* test,
                   const DividedChoice& choice) {
  BallPart out;
  if (!model.ball) {
    if (!choice.ball_effects.empty()) ball_layout_for(model, choice);  // says so
    return out;
  }
  out.train = recordings_with_ball(train);
  if (out.train.empty() && !choice.asked.empty())
    throw DataError(train.sample().front().source + ": got '" + choice.asked.front() +
                    "', which is of the ball, and no recording shows it; expected columns ball_x, "
                    "ball_y, ball_z [m] in the world's frame");
  if (out.train.empty()) return out;
  if (test) out.test = recordings_with_ball(*test);
  if (test && out.test.empty())
    throw DataError(test->sample().front().source +
                    ": held-out recordings must show the ball, too (ball_x, ball_y, ball_z)");
  out.alone = !has_torque(train);
  return out;
}

/// Nothing of the arm is fitted.
IdentifyResult without_arm(const Model& model, const RecordingSource& train, const FitChoice& arm) {
  IdentifyResult out;
  out.model = model;
  out.physically_consistent = true;
  for (const Recording& r : train.sample()) out.summary.rows += r.rows();
  out.data_report = train.report();
  if (joint_names(model).empty()) return out;
  std::string asked;
  if (arm.effects)
    for (const std::string& e : *arm.effects) asked += (asked.empty() ? "" : ", ") + e;
  out.notes.push_back((asked.empty() ? "" : kWarning) +
                      std::string("no torque was recorded: the arm's parameters stay as they are") +
                      (asked.empty() ? "" : ", and these effects are not fitted: " + asked));
  return out;
}

}  // namespace

bool has_torque(const RecordingSource& source) {
  return std::ranges::any_of(source.sample(), [](const Recording& r) {
    return std::ranges::find(r.has_tau, true) != r.has_tau.end() || r.base_wrench.size() > 0;
  });
}

std::string ball_note(const Model& model, const RecordingSource& train) {
  const bool seen =
      std::ranges::any_of(train.sample(), [](const Recording& r) { return r.ball.size() > 0; });
  if (seen && !model.ball)
    return std::string(kWarning) +
           "the recordings show a ball (ball_x, ball_y, ball_z) and the model has none: it was not "
           "looked at; give the model a ball, and a string if it hangs on one (docs/models.md)";
  if (model.ball && !seen)
    return "the model has a ball that the recordings do not show (ball_x, ball_y, ball_z): it "
           "stays as it is";
  return {};
}

void refuse_ball_alone(const Model& model, const RecordingSource& train) {
  const std::vector<Recording> sample = train.sample();
  const bool ball =
                 std::ranges::any_of(sample, [](const Recording& r) { return r.ball.size() > 0; }),
             torque = has_torque(train) || std::ranges::any_of(sample, [](const Recording& r) {
                        return !r.info.passive.empty();
                      });
  if (model.ball && !ball && !torque)
    throw DataError(sample.front().source +
                    ": it holds neither torques (tau_*) nor the ball (ball_x, ball_y, ball_z): "
                    "there is nothing to compare a model with");
  if (!model.ball && ball && !torque)
    throw ModelError(model.name + ": it has no ball, and " + sample.front().source +
                     " shows one (ball_x, ball_y, ball_z) but no torque; give the model a ball, "
                     "and a string if it hangs on one (docs/models.md)");
}

/// Free bases and constraints are served by the inverse loss, of the robot alone.
void require_served(const Model& model, const IdentifyOptions& options) {
  if (options.loss != Loss::kInverse) require_fixed_base("identify by this loss", model);
  if (model.ball) require_no_constraints("identify with a ball", model);
  if (options.loss != Loss::kInverse) require_no_constraints("identify by this loss", model);
}

void refuse_same_recording(const RecordingSource& train, const RecordingSource& test) {
  const std::vector<RunDescription> fitted = train.describe_runs();
  for (const RunDescription& b : test.describe_runs())
    for (const RunDescription& a : fitted)
      if (a.rows == b.rows)
        throw DataError(b.source + ": holds the same rows as " + a.source +
                        ", which is data of the fit; held-out data must be other recordings");
}

IdentifyResult identify(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const IdentifyOptions& options) {
  require_served(model, options);
  if (test) refuse_same_recording(train, *test);
  refuse_ball_alone(model, train);
  DividedChoice choice = divide_choice(model, options.choice);
  const BallPart ball = ball_part(model, train, test, choice);
  if (!ball.train.empty()) share_fix(model, choice);
  IdentifyOptions arm = options;
  arm.choice = choice.arm;
  std::unique_ptr<RecordingSource> arm_train, arm_test;  // without the ball's pull
  if (!ball.train.empty() && !ball.alone) {
    arm_train = without_ball_pull(model, train, options.ball, options.preprocess);
    if (test) arm_test = without_ball_pull(model, *test, options.ball, options.preprocess);
  }
  std::vector<std::string> of_drives;
  Model begun = model;
  if (!ball.alone && model.constraints.empty()) fit_drives(begun, train, arm, of_drives);
  const RecordingSource& fitted = arm_train ? *arm_train : train;
  std::optional<GeometryFit> geometry;
  if (!model.constraints.empty() && fits_kinematics(arm.choice)) {
    geometry = fit_geometry(model, fitted, arm.choice, arm);
    begun = geometry->model;
    arm.choice.fix.push_back("*.kinematics.*");
  }
  const RecordingSource* held_out = arm_test ? arm_test.get() : test;
  IdentifyResult result = ball.alone ? without_arm(model, train, choice.arm)
                          : arm.loss == Loss::kMotion
                              ? identify_by_motion(begun, fitted, held_out, arm)
                              : identify_by_torque(geometry ? begun : model, fitted, held_out, arm);
  if (geometry) {
    for (ParameterEstimate& p : result.parameters)
      for (const ParameterEstimate& q : geometry->parameters)
        if (p.name == q.name) p = q;
    result.notes.insert(result.notes.end(), geometry->notes.begin(), geometry->notes.end());
  }
  result.notes.insert(result.notes.begin(), of_drives.begin(), of_drives.end());
  if (arm_train) {
    result.data_report = train.report();
    result.notes.push_back(ball_pull_note(train));
  }
  if (arm_test) result.notes.push_back("held-out data: " + ball_pull_note(*test));
  if (!ball.train.empty() && !result.summary.interrupted) {
    const auto start = std::chrono::steady_clock::now();
    identify_ball(ball.train, ball.test, choice, options, result);
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    result.summary.seconds += seconds;
    result.summary.seconds_fitting += seconds;
  } else if (!ball.train.empty()) {
    result.summary.converged = false;
    result.summary.termination += "; the ball was not fitted";
  }
  if (const std::string note = ball_note(model, train); !note.empty()) result.notes.push_back(note);
  add_warnings(model, train, test, result);
  if (test && test->report().quarantined > 0)
    result.notes.push_back("held-out data: " + std::to_string(test->report().quarantined) + " of " +
                           std::to_string(test->report().rows) +
                           " recorded rows cannot be true and were quarantined");
  for (const std::string& note : model.notes) result.notes.push_back("the description: " + note);
  return result;
}

IdentifyResult identify(const Model& model, const std::vector<Recording>& train,
                        const std::vector<Recording>& test, const IdentifyOptions& options) {
  require_served(model, options);
  const auto source = recordings_in_memory(model, train);
  std::unique_ptr<RecordingSource> held_out;
  if (!test.empty()) held_out = recordings_in_memory(model, test);
  return identify(model, *source, held_out.get(), options);
}

}  // namespace diffnea
