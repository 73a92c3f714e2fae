#include "identify/motion_data.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

#include "core/constants.hpp"
#include "identify/motionless.hpp"
#include "identify/passes.hpp"
#include "identify/whole_runs.hpp"
#include "recording/held_rows.hpp"
#include "recording/overlap.hpp"
#include "recording/time_unit.hpp"

namespace diffnea {
namespace {

/// Noise over which an error is one of the model [standard deviations].
constexpr double kFarBeyondNoise = 10.0;

std::vector<bool> passive_joints(const Recording& recording) {
  std::vector<bool> out;
  for (const std::string& joint : recording.joint_names)
    out.push_back(std::ranges::find(recording.info.passive, joint) != recording.info.passive.end());
  return out;
}

/// Recordings of a source, whole, with numbers from `first_run` on.
std::vector<Recording> whole_runs(const RecordingSource& source, int first_run) {
  std::vector<Recording> out;
  for_each_run(
      source, [](const Recording&) { return true; },
      [&](const Recording& r) {
        out.push_back(r);
        out.back().run += first_run;
      });
  return out;
}

/// Words on joints that nobody has measured the torque of; empty if there is none.
std::string without_torque(const Recording& r) {
  std::vector<std::string> joints;
  const std::vector<bool> passive = passive_joints(r);
  for (std::size_t j = 0; j < passive.size(); ++j)
    if (!r.has_tau[j] && !passive[j]) joints.push_back(r.joint_names[j]);
  return joints.empty() ? ""
                        : "; of " + detail::join(joints) +
                              " no torque is known: declare joints without a drive passive "
                              "(sidecar, or --passive)";
}

/// Takes out the positions of rows in which something holds a joint, of which no model knows.
/// @param commanded  (n) joints that drives of the model lead
/// @param kind       of the recordings, in a note
void leave_out_held(const Model& model, std::vector<Recording>& recordings,
                    const std::vector<bool>& commanded, const char* kind,
                    std::vector<std::string>& notes) {
  for (std::size_t j = 0; j < commanded.size(); ++j) {
    const int joint = static_cast<int>(j);
    if (!commanded[j]) continue;
    const std::vector<detail::HeldRows> held = detail::find_held(recordings, joint);
    if (held.empty()) continue;
    for (const detail::HeldRows& h : held)
      recordings[h.recording].q.col(joint).segment(h.first, h.rows).setConstant(kNaN);
    notes.push_back(kWarning +
                    (recordings.front().joint_names[j] + " " +
                     detail::held_text(recordings, held, unit_of_joint(model, joint, false)) +
                     ". These rows" + kind + " do not count for it"));
  }
}

/// Recordings cut into stretches; what has none is noted.
/// @param commanded  (n) joints that drives of the model lead
std::vector<MotionStretch> stretches_of(const std::vector<Recording>& recordings,
                                        const SensorNoise& noise,
                                        const std::vector<bool>& commanded,
                                        std::vector<std::string>& notes) {
  std::vector<MotionStretch> out;
  for (const Recording& r : recordings) {
    std::vector<MotionStretch> of_run = motion_stretches(r, noise, passive_joints(r), commanded);
    if (of_run.empty())
      notes.push_back("left out: " + r.source +
                      " has no three rows on end with a torque of every "
                      "joint");
    std::ranges::move(of_run, std::back_inserter(out));
  }
  if (const std::string question = detail::time_unit_question(recordings); !question.empty())
    throw DataError(recordings.front().source + ": " + question);
  if (out.empty() && !recordings.empty())
    throw DataError(recordings.front().source + ": " + detail::why_no_rows(recordings, 3) +
                    ", so nothing can be simulated" + without_torque(recordings.front()));
  for (long j = 0; !out.empty() && j < noise.position.size(); ++j)
    if (std::ranges::all_of(out, [&](const MotionStretch& s) {
          return s.q.col(j).array().isNaN().all();
        }))
      throw DataError(recordings.front().source + ": joint '" +
                      recordings.front().joint_names[static_cast<std::size_t>(j)] +
                      "' has no position in rows in which all torques are known: " +
                      detail::uneven_columns(recordings));
  return out;
}

}  // namespace

MotionData motion_data(const Model& model, const RecordingSource& train,
                       const RecordingSource* test, const std::vector<bool>& commanded,
                       std::vector<std::string>& notes) {
  MotionData out;
  std::vector<Recording> fitted = whole_runs(train, 0);
  out.noise = sensor_noise(fitted, passive_joints(fitted.front()));
  leave_out_held(model, fitted, commanded, "", notes);
  out.train = stretches_of(fitted, out.noise, commanded, notes);
  for (const Recording& r : fitted) out.rows += r.rows();
  if (test) {
    std::vector<Recording> held_out = whole_runs(*test, static_cast<int>(train.runs().size()));
    leave_out_held(model, held_out, commanded, ", held out,", notes);
    out.test = stretches_of(held_out, out.noise, commanded, notes);
  }
  out.runs.resize(train.runs().size() + (test ? test->runs().size() : 0));
  std::iota(out.runs.begin(), out.runs.end(), 0);
  return out;
}

std::vector<int> still_joints(const std::vector<MotionStretch>& stretches,
                              const SensorNoise& noise) {
  const PositionRange range = position_range(stretches, noise.position.size());
  return motionless_joints(range.low, range.high,
                           {noise.position.begin(), noise.position.end()});
}

VecX<double> apart_limit(const MotionData& data) {
  return (kApart * motion_size(data.train)).cwiseMax(kFarBeyondNoise * data.noise.position);
}

}  // namespace diffnea
