#include "diagnose/held_out_motion.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/motion/horizon.hpp>

#include "core/constants.hpp"
#include "diagnose/sticking.hpp"
#include "identify/whole_runs.hpp"
#include "recording/fresh_positions.hpp"

namespace diffnea {
namespace {

/// Error over the sensor's noise, standard deviations, that noise alone hardly ever makes (0.3 %).
constexpr double kNoises = 3.0;
/// Error over the range of motion that counts as following: a line's width in a plot of it.
constexpr double kOfRange = 0.01;
/// Rows of all recordings after which no other is read: a quarter of an hour at 1 kHz.
constexpr long kMostRows = 1'000'000;

/// Part of a recording that is held out [s].
struct Span {
  int run;
  double first, last;
};

std::vector<Span> held_out_spans(const Evidence& evidence, const std::vector<bool>& held) {
  std::vector<Span> out;
  int of = -1;  // stretch of the span that goes on
  for (long i = 0; i < evidence.times(); ++i) {
    const std::size_t at = static_cast<std::size_t>(i);
    const int stretch = held[at] ? evidence.stretch()[at] : -1;
    if (stretch >= 0 && stretch != of)
      out.push_back({evidence.series()[stretch].run, evidence.time()[at], evidence.time()[at]});
    if (stretch >= 0) out.back().last = evidence.time()[at];
    of = stretch;
  }
  return out;
}

/// Rows from one time to another.
Recording part_of(const Recording& r, double first, double last) {
  const double* time = r.time.data();
  const long from = std::lower_bound(time, time + r.rows(), first) - time,
             rows = std::upper_bound(time, time + r.rows(), last) - time - from;
  return detail::part(r, from, rows);
}

/// Rows that have a torque of every joint that has any: no other is simulated.
Recording with_torques(const Recording& r) {
  std::vector<long> rows;
  for (long i = 0; i < r.rows(); ++i) {
    bool lacks = false;
    for (long j = 0; j < r.tau.cols(); ++j)
      lacks = lacks || (r.has_tau[j] && std::isnan(r.tau(i, j)));
    if (!lacks) rows.push_back(i);
  }
  if (std::ssize(rows) == r.rows()) return r;
  Recording out = detail::part(r, 0, 0);
  out.time = r.time(rows);
  out.q = r.q(rows, Eigen::all);
  out.tau = r.tau(rows, Eigen::all);
  if (r.qd.size() > 0) out.qd = r.qd(rows, Eigen::all);
  return out;
}

/// Torques as they act, on lines between those that were logged; at the end the last one stays.
void act_late(Recording& r, double late) {
  if (late == 0.0) return;
  const RowMatX<double> logged = r.tau;
  long before = 0;  // row at or before the instant
  for (long k = 0; k < r.rows(); ++k) {
    const double at = r.time[k] - late;
    while (before + 2 < r.rows() && r.time[before + 1] <= at) ++before;
    const double step = r.rows() > 1 ? r.time[before + 1] - r.time[before] : 0.0;
    const double share = step > 0.0 ? std::clamp((at - r.time[before]) / step, 0.0, 1.0) : 0.0;
    r.tau.row(k) = logged.row(before);
    if (share > 0.0) r.tau.row(k) += share * (logged.row(before + 1) - logged.row(before));
  }
}

std::vector<bool> passive_joints(const Recording& r) {
  std::vector<bool> out;
  for (const std::string& joint : r.joint_names)
    out.push_back(std::ranges::find(r.info.passive, joint) != r.info.passive.end());
  return out;
}

/// First joint that moves by what nobody has recorded; empty if there is none.
std::string prescribed_joint(const Recording& r, const std::vector<bool>& passive) {
  for (std::size_t j = 0; j < passive.size(); ++j)
    if (!passive[j] && !r.has_tau[j] && r.tau.col(j).array().isNaN().all()) return r.joint_names[j];
  return "";
}

/// By run: driven joints that stand still, whatever torque holds them.
std::map<int, std::vector<int>> resting_joints(const std::vector<MotionStretch>& stretches,
                                               const std::vector<bool>& passive,
                                               const SensorNoise& noise) {
  std::map<int, std::vector<std::vector<double>>> of_run;
  for (const MotionStretch& s : stretches) {
    auto& joints = of_run[s.run];
    joints.resize(passive.size());
    for (std::size_t j = 0; j < passive.size(); ++j)
      std::ranges::copy_if(s.q.col(j), std::back_inserter(joints[j]),
                           [](double q) { return !std::isnan(q); });
  }
  std::map<int, std::vector<int>> out;
  for (const auto& [run, joints] : of_run)
    for (std::size_t j = 0; j < joints.size(); ++j)
      if (!passive[j] && !joints[j].empty() && stands_all_along(joints[j], noise.position[j]))
        out[run].push_back(static_cast<int>(j));
  return out;
}

/// Rows of which the shortest window still has enough: others cost time and tell nothing new.
std::size_t kept_of(const std::vector<MotionStretch>& stretches, const SensorNoise& noise) {
  constexpr double kRows = 12.0;  // rows of the shortest window: a state is two numbers
  const double shortest = horizons(stretches, noise, {}).front();
  const bool slow = std::ranges::any_of(noise.refresh, [](int rows) { return rows > 1; });
  const double every = std::floor(shortest / (kRows * noise.period.maxCoeff()) * (1.0 + 1e-9));
  return slow || !(every > 1.0) ? 1 : static_cast<std::size_t>(every);
}

/// Every so many rows, with the mean of the torques between them.
MotionStretch thinned(const MotionStretch& s, std::size_t every) {
  const std::size_t m = s.time.size();
  MotionStretch out;
  out.run = s.run;
  std::vector<long> kept;
  for (std::size_t k = 0; k < m; k += every) kept.push_back(static_cast<long>(k));
  if (kept.back() != static_cast<long>(m) - 1) kept.push_back(static_cast<long>(m) - 1);
  for (const long k : kept) out.time.push_back(s.time[k]);
  out.q = s.q(kept, Eigen::all);
  out.u = s.u(kept, Eigen::all);
  for (std::size_t i = 0; i + 1 < kept.size(); ++i) {
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(s.u.cols());
    for (long k = kept[i]; k < kept[i + 1]; ++k) {
      const std::size_t at = static_cast<std::size_t>(k);
      sum += 0.5 * (s.time[at + 1] - s.time[at]) * (s.u.row(k) + s.u_end.row(k));
    }
    out.u.row(i) = sum / (out.time[i + 1] - out.time[i]);
  }
  out.u_end = out.u;
  out.command = s.command;
  return out;
}

}  // namespace

HeldOutMotion motion_of_stretches(std::vector<MotionStretch> stretches, const SensorNoise& noise) {
  HeldOutMotion out;
  out.noise = noise;
  out.stretches = std::move(stretches);
  if (out.stretches.empty()) {
    out.reason = "no three held-out rows on end have a torque of every joint";
    return out;
  }
  for (const MotionStretch& s : out.stretches) out.begins.try_emplace(s.run, s.time.front());
  out.size = motion_size(out.stretches).cwiseMax(kNoises * noise.position);
  const PositionRange range = position_range(out.stretches, noise.position.size());
  out.tolerance = (kNoises * noise.position).cwiseMax(kOfRange * (range.high - range.low).cwiseMax(0.0));
  if (const std::size_t every = kept_of(out.stretches, noise); every > 1)
    for (MotionStretch& s : out.stretches) s = thinned(s, every);
  return out;
}

HeldOutMotion motion_of(const std::vector<Recording>& parts) {
  HeldOutMotion out;
  if (parts.empty()) {
    out.reason = "no row is held out";
    return out;
  }
  const std::vector<bool> passive = passive_joints(parts.front());
  for (const Recording& r : parts) {
    out.begins.try_emplace(r.run, r.rows() > 0 ? r.time[0] : 0.0);
    if (const std::string joint = prescribed_joint(r, passive); !joint.empty())
      out.reason =
          "the torque of " + joint + " was not recorded: its motion is an input, not a result";
    for (long j = 0; j < r.q.cols(); ++j)
      if (r.q.col(j).array().isNaN().all())
        out.reason = "the position of " + r.joint_names[j] + " was not recorded";
    if (!out.reason.empty()) return out;
  }
  const SensorNoise noise = sensor_noise(parts, passive);
  std::vector<MotionStretch> stretches;
  for (const Recording& r : parts)
    std::ranges::move(motion_stretches(r, noise, passive), std::back_inserter(stretches));
  std::map<int, std::vector<int>> resting = resting_joints(stretches, passive, noise);
  HeldOutMotion simulated = motion_of_stretches(std::move(stretches), noise);
  simulated.resting = std::move(resting);
  simulated.begins = std::move(out.begins);
  return simulated;
}

HeldOutMotion held_out_motion(const RecordingSource& source, const Evidence& evidence,
                              const std::vector<bool>& held, double late) {
  std::vector<Recording> parts;
  std::map<int, double> begins;
  const std::vector<Span> spans =
      held.empty() ? std::vector<Span>{} : held_out_spans(evidence, held);
  long rows = 0;
  for_each_run(
      source, [&](const Recording&) { return rows < kMostRows; },
      [&](const Recording& r) {
        const int run = evidence.first_run() + r.run;
        begins[run] = r.time[0];
        const auto keep = [&](double first, double last) {
          parts.push_back(with_torques(part_of(r, first, last)));
          act_late(parts.back(), late);
          parts.back().run = run;
          rows += parts.back().rows();
        };
        if (held.empty()) keep(-kInfinity, kInfinity);
        for (const Span& s : spans)
          if (s.run == run) keep(s.first, s.last);
      });
  HeldOutMotion out = motion_of(parts);
  out.begins = std::move(begins);
  return out;
}

}  // namespace diffnea
