#include <algorithm>
#include <chrono>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>

#include "diagnose/ball_diagnose.hpp"
#include "diagnose/joint_diagnosis.hpp"
#include "diagnose/motion_diagnosis.hpp"
#include "diagnose/unfolded_base.hpp"
#include "identify/ball_identify.hpp"
#include "identify/ball_pull.hpp"
#include "identify/passes.hpp"

namespace diffnea {

namespace {

/// Effects that are asked for and act on joints, or on the ball.
std::vector<std::string> asked_for(const DiagnoseOptions& options, bool of_ball) {
  std::vector<std::string> out;
  for (const std::string& e : options.effects)
    if (acts_on_ball(find_effect(e.substr(0, e.find('@')))) == of_ball) out.push_back(e);
  return out;
}

/// Flights of a robot that floats: its base on joints that nothing drives.
Finding diagnose_flights(const Model& model, const RecordingSource& train,
                         const RecordingSource* test, const DiagnoseOptions& options) {
  const UnfoldedBase floats(model, train, test);
  Finding out = diagnose_joints(floats.model(), floats.train(), floats.test(),
                                floats.unfold(options), &floats);
  floats.fold(out);
  return out;
}

}  // namespace

Finding find_causes(const Model& model, const RecordingSource& train, const RecordingSource* test,
                    const DiagnoseOptions& options) {
  if (test) refuse_same_recording(train, *test);
  refuse_ball_alone(model, train);
  const std::vector<Recording> balls =
      model.ball ? recordings_with_ball(train) : std::vector<Recording>{};
  const std::vector<std::string> of_ball = asked_for(options, true);
  if (balls.empty() && !of_ball.empty())
    throw DataError(train.sample().front().source + ": got the effect '" + of_ball.front() +
                    "', which is of a ball, and " +
                    (model.ball ? "no recording shows it; expected columns ball_x, ball_y, ball_z "
                                  "[m] in the world's frame"
                                : "the model has none"));
  const bool drives = balls.empty() && has_commands_alone(model, train);
  if (drives || !balls.empty())
    require_plain_tree(drives ? "diagnose by commands" : "diagnose with a ball", model);
  if (model.free_base) return diagnose_flights(model, train, test, options);
  if (drives) return diagnose_drives(model, train, test, options);
  if (balls.empty()) {
    Finding finding = diagnose_joints(model, train, test, options);
    if (const std::string note = ball_note(model, train); !note.empty())
      finding.notes.push_back(note);
    return finding;
  }
  std::vector<Recording> held_out;
  if (test) held_out = recordings_with_ball(*test);
  if (test && held_out.empty())
    throw DataError(test->sample().front().source +
                    ": held-out recordings must show the ball, too (ball_x, ball_y, ball_z)");
  const auto start = std::chrono::steady_clock::now();
  DiagnoseOptions own = options;
  Finding finding;
  finding.model = model;
  finding.data_report = train.report();
  own.effects = asked_for(options, false);
  own.own_alone = own.own_alone || (!options.effects.empty() && own.effects.empty());
  const bool joints =
      has_torque(train) && (!own.own_alone || !own.effects.empty() || !options.candidates.empty());
  if (!joints && !own.effects.empty())
    throw DataError(train.sample().front().source + ": got the effect '" + own.effects.front() +
                    "', which is of joints, and no torque was recorded; expected columns tau_*, or "
                    "effects of the ball (`diffnea effects`)");
  if (joints) {
    const BallFitOptions fit;
    const auto arm = without_ball_pull(model, train, fit, options.preprocess);
    const auto arm_test = test ? without_ball_pull(model, *test, fit, options.preprocess) : nullptr;
    finding = diagnose_joints(model, arm ? *arm : train, arm_test ? arm_test.get() : test, own);
    if (arm) finding.notes.push_back(ball_pull_note(train));
    if (arm_test) finding.notes.push_back("held-out data: " + ball_pull_note(*test));
    finding.data_report = train.report();
  }
  own.effects = of_ball;
  if (finding.interrupted || (!options.whole_catalogue() && own.effects.empty())) return finding;
  const Base base = options.base == Base::kAuto ? Base::kPrior : options.base;
  if (!joints) {
    finding.base = base == Base::kFixed ? "fixed" : fits_string(model, base) ? "refit" : "prior";
    finding.simulated.reason = "the joints' measured motion is an input";
  }
  diagnose_ball(balls, held_out, own, base, finding);
  finding.tried = options.whole_catalogue() ? Tried::kAll : Tried::kSome;
  finding.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return finding;
}

Finding diagnose(const Model& model, const std::vector<Recording>& train,
                 const std::vector<Recording>& test, const DiagnoseOptions& options) {
  const auto source = recordings_in_memory(model, train);
  std::unique_ptr<RecordingSource> held_out;
  if (!test.empty()) held_out = recordings_in_memory(model, test);
  return diagnose(model, *source, held_out.get(), options);
}

}  // namespace diffnea
