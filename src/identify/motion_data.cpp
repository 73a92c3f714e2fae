#include "identify/motion_data.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

#include "core/constants.hpp"
#include "identify/motionless.hpp"
#include "identify/whole_runs.hpp"
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

MotionData motion_data(const RecordingSource& train, const RecordingSource* test,
                       const std::vector<bool>& commanded, std::vector<std::string>& notes) {
  MotionData out;
  const std::vector<Recording> fitted = whole_runs(train, 0);
  out.noise = sensor_noise(fitted, passive_joints(fitted.front()));
  out.train = stretches_of(fitted, out.noise, commanded, notes);
  for (const Recording& r : fitted) out.rows += r.rows();
  if (test)
    out.test = stretches_of(whole_runs(*test, static_cast<int>(train.runs().size())), out.noise,
                            commanded, notes);
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
