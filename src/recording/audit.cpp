#include <algorithm>
#include <cmath>
#include <numbers>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/recording/audit.hpp>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"
#include "recording/axis_columns.hpp"
#include "recording/columns.hpp"
#include "recording/credible_rows.hpp"
#include "recording/path_smoother.hpp"

namespace diffnea {
namespace {

using namespace detail;

/// Share of a column that must hold numbers for it to be compared with another.
constexpr double kMeasuredShare = 0.5;

std::vector<JointDescription> joints_of(const Recording& first, const AuditLimits& limits) {
  std::vector<JointDescription> out;
  for (const std::string& name : first.joint_names) {
    const auto it = std::ranges::find(limits.joints, name, &JointDescription::name);
    if (it != limits.joints.end())
      out.push_back(*it);
    else
      out.push_back({.name = name});
  }
  return out;
}

double median_interval(const std::vector<Recording>& recordings) {
  std::vector<double> steps;
  for (const Recording& r : recordings)
    for (long i = 1; i < r.rows(); ++i) steps.push_back(r.time[i] - r.time[i - 1]);
  return steps.empty() ? 0.0 : quantile(std::move(steps), 0.5);
}

double severity_rank(const ChannelFault& f) {
  return (f.severity == FaultSeverity::kFault ? 1e12 : 0.0) +
         (std::isnan(f.significance) ? 0.0 : std::min(f.significance, 1e9));
}

/// One fault per channel: where several recordings have it, the largest stands for all.
void merge_recordings(std::vector<ChannelFault>& faults, std::size_t num_recordings) {
  std::vector<ChannelFault> merged;
  std::vector<long> count;
  for (ChannelFault& f : faults) {
    const auto same = std::ranges::find_if(merged, [&](const ChannelFault& m) {
      return m.fault == f.fault && m.channel == f.channel && !m.source.empty() &&
             m.source != f.source;
    });
    if (same == merged.end()) {
      merged.push_back(std::move(f));
      count.push_back(1);
      continue;
    }
    ++count[same - merged.begin()];
    if (std::pair(f.severity, std::abs(f.value)) > std::pair(same->severity, std::abs(same->value)))
      *same = std::move(f);
  }
  for (std::size_t i = 0; i < merged.size(); ++i)
    if (count[i] > 1)
      merged[i].evidence =
          format("in %ld of %zu recordings, here the largest: ", count[i], num_recordings) +
          merged[i].evidence;
  faults = std::move(merged);
}

}  // namespace

namespace detail {

ChannelFault make_fault(std::string fault, std::string where, std::string channel, double value,
                        std::string unit) {
  ChannelFault out;
  out.fault = std::move(fault);
  out.where = std::move(where);
  out.channel = std::move(channel);
  out.value = value;
  out.unit = std::move(unit);
  return out;
}

void for_each_channel(const AuditContext& context,
                      const std::function<void(const ChannelView&)>& look) {
  for (std::size_t k = 0; k < context.recordings.size(); ++k) {
    const Recording& r = context.recordings[k];
    const auto joints = [&](const RowMatX<double>& m, const char* prefix, char kind,
                            const std::string& per) {
      for (int j = 0; j < m.cols() && j < context.num_joints(); ++j) {
        if (kind == 't' && !r.has_tau[j]) continue;
        const std::string unit =
            kind == 't' ? context.torque_unit(j) : context.position_unit(j) + per;
        look({r.joint_names[j], prefix + r.joint_names[j], unit, kind, j, k, m.col(j)});
      }
    };
    joints(r.q, "q_", 'q', "");
    joints(r.qd, "qd_", 'v', "/s");
    joints(r.qdd, "qdd_", 'a', "/s^2");
    joints(r.qcmd, "qcmd_", 'c', "");
    joints(r.tau, "tau_", 't', "");
    for (const AxisColumns& of : kAxisColumns)
      for (std::size_t axis = 0; (r.*of.series).size() > 0 && axis < of.axes.size(); ++axis)
        look({std::string(of.where), of.column(axis), std::string(of.unit), 'x', -1, k,
              (r.*of.series).col(of.first + static_cast<long>(axis))});
  }
}

void filter_channels(AuditContext& c) {
  const int n = c.num_joints();
  c.has_qd.assign(n, false);
  c.has_qdd.assign(n, false);
  c.has_tau.assign(n, false);
  c.velocity_noise.assign(n, 0.0);
  if (n == 0 && c.recordings.front().base.size() == 0) {
    c.unfiltered_reason = "there is no joint";
    return;
  }
  const auto measured = [&](RowMatX<double> Recording::* member, int j) {
    double finite = 0.0, rows = 0.0;
    for (const Recording& r : c.recordings) {
      const RowMatX<double>& m = r.*member;
      if (m.size() == 0) continue;
      rows += static_cast<double>(r.rows());
      finite += static_cast<double>(m.col(j).array().isFinite().count());
    }
    return rows > 0.0 && finite > kMeasuredShare * rows;
  };
  for (int j = 0; j < n; ++j) {
    c.has_qd[j] = measured(&Recording::qd, j);
    c.has_qdd[j] = measured(&Recording::qdd, j);
    c.has_tau[j] = c.recordings.front().has_tau[j] && measured(&Recording::tau, j);
  }
  try {
    c.plan = plan_preprocess(c.recordings, {});
  } catch (const DataError& error) {
    c.unfiltered_reason = error.what();
    return;
  }
  if (n == 0) {
    c.unfiltered_reason = "there is no joint";
    return;
  }
  // Noise of q, white up to the cut-off, as noise of q̇: its density times ω².
  const double band = std::min(c.plan->filter_hz, 0.5 / c.plan->dt);
  for (int j = 0; j < n; ++j)
    c.velocity_noise[j] = c.plan->q_noise[j] * std::sqrt(8.0 * std::numbers::pi * std::numbers::pi *
                                                         c.plan->dt * band * band * band / 3.0);

  const long ends = detail::PathSmoother(c.plan->filter_hz, 1.0 / c.plan->dt).memory(1e-4);
  for (std::size_t k = 0; k < c.recordings.size(); ++k) {
    const Recording& r = c.recordings[k];
    // All channels as if they were positions: they get the same grid and the same filter.
    std::vector<VecX<double>> columns;
    for (int j = 0; j < n; ++j) columns.emplace_back(r.q.col(j));
    for (int j = 0; j < n; ++j)
      if (c.has_qd[j] && r.qd.size() > 0) columns.emplace_back(r.qd.col(j));
    for (int j = 0; j < n; ++j)
      if (c.has_qdd[j] && r.qdd.size() > 0) columns.emplace_back(r.qdd.col(j));
    for (int j = 0; j < n; ++j)
      if (c.has_tau[j]) {
        VecX<double> tau = r.tau.col(j);
        if (r.info.torque_sampling == TorqueSampling::kHold)  // what acted about row k
          for (long i = r.rows() - 1; i > 0; --i) tau[i] = 0.5 * (tau[i] + tau[i - 1]);
        columns.push_back(std::move(tau));
      }
    Recording stack;
    stack.source = r.source;
    stack.run = r.run;
    stack.time = r.time;
    stack.q.resize(r.rows(), static_cast<long>(columns.size()));
    for (std::size_t i = 0; i < columns.size(); ++i) {
      stack.q.col(static_cast<long>(i)) = columns[i];
      stack.joint_names.push_back(std::to_string(i));
    }
    stack.has_tau.assign(columns.size(), false);
    stack.tau.setZero(r.rows(), stack.q.cols());
    stack.info.torque_sampling = TorqueSampling::kInstant;
    const Preprocessed p = preprocess(stack, *c.plan);
    for (long begin = 0, end = 0; begin < p.rows(); begin = end) {
      while (end < p.rows() && p.segment[end] == p.segment[begin]) ++end;
      // What the filter makes of the ends differs from channel to channel.
      const long trim = std::min(ends, (end - begin) / 8), from = begin + trim, to = end - trim;
      if (to - from < 8) continue;
      FilteredStretch s;
      s.recording = k;
      s.time = p.time.segment(from, to - from);
      const auto part = [&](const RowMatX<double>& m, long column) {
        return m.block(from, column, to - from, 1);
      };
      s.q = p.q.block(from, 0, to - from, n);
      s.qd = p.qd.block(from, 0, to - from, n);
      s.qdd = p.qdd.block(from, 0, to - from, n);
      if (r.qd.size() > 0) s.measured_qd.setZero(to - from, n);
      if (r.qdd.size() > 0) s.measured_qdd.setZero(to - from, n);
      s.tau.setZero(to - from, n);
      long at = n;
      for (int j = 0; j < n; ++j)
        if (c.has_qd[j] && r.qd.size() > 0) s.measured_qd.col(j) = part(p.q, at++);
      for (int j = 0; j < n; ++j)
        if (c.has_qdd[j] && r.qdd.size() > 0) s.measured_qdd.col(j) = part(p.q, at++);
      for (int j = 0; j < n; ++j)
        if (c.has_tau[j]) s.tau.col(j) = part(p.q, at++);
      c.stretches.push_back(std::move(s));
    }
  }
  if (c.stretches.empty())
    c.unfiltered_reason = "no stretch without a gap is long enough to be filtered";
}

}  // namespace detail

AuditReport audit(const std::vector<Recording>& recordings, const AuditLimits& limits) {
  if (recordings.empty()) throw DataError("audit: got no recording, expected one or more");
  for (const Recording& r : recordings)
    if (r.joint_names != recordings.front().joint_names)
      throw DataError(r.source + ": the joints are not those of " + recordings.front().source +
                      ": " + detail::join_or_none(r.joint_names) + "; " +
                      detail::join_or_none(recordings.front().joint_names));
  AuditReport report;
  AuditContext context(recordings, limits, report);
  context.joints = joints_of(recordings.front(), limits);
  context.has_model = !limits.joints.empty();
  context.dt = median_interval(recordings);
  for (const Recording& r : recordings) report.rows += r.rows();
  report.rate_hz = context.dt > 0.0 ? 1.0 / context.dt : 0.0;
  filter_channels(context);
  audit_time(context);
  audit_dead(context);
  audit_stuck(context);
  audit_spikes(context);
  audit_limits(context);
  audit_velocity(context);
  audit_base(context);
  audit_torque(context);
  audit_effort(context);
  audit_command(context);
  audit_period(context);
  merge_recordings(report.faults, recordings.size());
  std::ranges::stable_sort(report.faults, [](const ChannelFault& a, const ChannelFault& b) {
    return severity_rank(a) > severity_rank(b);
  });
  return report;
}

void add_reading(const ReadReport& reading, AuditReport& report) {
  long repeated = 0, impossible = 0, set_back = 0;
  std::string first_repeated, first_impossible;
  for (const QuarantinedRow& row : reading.quarantined_rows) {
    const bool repeats = row.reason.starts_with("time repeats");
    const bool sets = row.reason.starts_with(detail::kSetBack);
    set_back += sets ? 1 : 0;
    (repeats ? repeated : impossible)++;
    std::string& first = repeats ? first_repeated : first_impossible;
    if (first.empty() || (sets && set_back == 1))
      first = "line " + std::to_string(row.line) + ": " + row.reason;
  }
  // Those that are not listed are of the kind that is.
  (impossible == 0 ? repeated : impossible) += reading.quarantined - repeated - impossible;
  const auto add = [&](const char* name, long count, const std::string& first) {
    if (count == 0) return;
    const double share = static_cast<double>(count) / static_cast<double>(reading.rows);
    ChannelFault f = make_fault(name, "time", "time", static_cast<double>(count), "rows");
    const bool refused = share > 0.01 || (set_back > 0 && count == impossible);
    f.severity = refused ? FaultSeverity::kFault : FaultSeverity::kNote;
    f.source = reading.source;
    f.evidence = format("%ld of %ld rows were left out (%.2g %%); the first: %s", count,
                        reading.rows, 100.0 * share, first.c_str());
    const auto at =
        f.severity == FaultSeverity::kFault ? report.faults.begin() : report.faults.end();
    report.faults.insert(at, std::move(f));
  };
  add("repeated_time", repeated, first_repeated);
  add("impossible_rows", impossible, first_impossible);
}

std::vector<std::pair<std::string, std::string>> audit_fault_names() {
  return {
      {"impossible_rows", "rows that cannot be true and were left out when reading"},
      {"repeated_time", "rows with the time of the row before"},
      {"time_unit", "rows so far apart that the time must be in another unit"},
      {"time_gap", "rows are missing: the clock jumps ahead"},
      {"time_jitter", "intervals between rows vary"},
      {"time_rate_change", "the interval between rows changes during the recording"},
      {"dead_channel", "a channel that stays constant, or empty, while its joint moves"},
      {"coarse_quantisation", "few steps of a channel cover its whole range"},
      {"sample_and_hold", "a channel is refreshed more slowly than rows are written"},
      {"stuck_samples", "single rows repeat the value before although the channel moves"},
      {"frozen_channel", "a channel stands still for a while and then jumps"},
      {"spike", "isolated values far off their neighbours"},
      {"torque_clipped", "flat tops: the torque stays at its largest value"},
      {"position_clipped", "flat tops: the position stays at its extreme, entered with speed"},
      {"torque_beyond_limit", "torque above the model's effort limit"},
      {"torque_unit", "torque so far above the limits that its unit must be another"},
      {"position_beyond_limit", "position outside the model's limits"},
      {"degrees", "positions that fit their range as degrees"},
      {"length_unit", "positions of a slide that fit its range as mm or cm"},
      {"position_wrapped", "a hinge's position jumps by a whole turn and stays there"},
      {"velocity_sign", "measured velocity has the sign of −dq/dt"},
      {"velocity_scale", "measured velocity is a multiple of dq/dt"},
      {"velocity_filter_lag", "measured velocity is dq/dt through a low-pass, or late"},
      {"velocity_offset", "measured velocity has a constant part that dq/dt lacks"},
      {"velocity_swapped", "measured velocity is that of another joint"},
      {"velocity_unrelated", "measured velocity is not that of any joint"},
      {"acceleration_sign", "as velocity_sign, for qdd and d²q/dt²"},
      {"acceleration_scale", "as velocity_scale, for qdd and d²q/dt²"},
      {"acceleration_filter_lag", "as velocity_filter_lag, for qdd and d²q/dt²"},
      {"acceleration_offset", "as velocity_offset, for qdd and d²q/dt²"},
      {"acceleration_swapped", "as velocity_swapped, for qdd and d²q/dt²"},
      {"acceleration_unrelated", "as velocity_unrelated, for qdd and d²q/dt²"},
      {"quaternion_norm", "quaternions of a base that floats are not unit"},
      {"quaternion_sign", "quaternions of a base that floats change their sign"},
      {"twist_frame", "the base's measured twist is in the world's axes"},
      {"time_shift", "a channel is a pure delay later (or earlier) than the positions"},
      {"torque_sign",
       "torque drops where its joint's velocity turns positive, or falls as it accelerates"},
      {"torque_swapped", "torque jumps at the reversals of another joint"},
      {"effort_is_current", "torques are another multiple of what the model's links need"},
      {"twos_complement", "negative numbers of a drive were read as large positive ones"},
      {"command_swapped", "the desired position follows the position: the columns are exchanged"},
      {"command_late", "the desired position is stamped later than what it brings about"},
      {"held", "something holds a joint while its command goes on"},
      {"one_time_stamp", "commands and positions of several drives share one stamp a row"},
      {"period", "the period that the sidecar states is not that of the motion"},
  };
}

}  // namespace diffnea
