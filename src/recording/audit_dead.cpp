/// Channels that say nothing: constant or empty while their joint moves; steps too coarse for the
/// motion.

#include <algorithm>
#include <cmath>
#include <map>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea::detail {
namespace {

/// A range of fewer steps than this is coarse: rounding is then 1 % of the range and more.
constexpr double kFewSteps = 64.0;
/// Motion that is worth the name [rad, m].
constexpr double kMoves = 1e-3;

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low, quantum = 0.0;
  long finite = 0, rows = 0;
  std::string channel, where, unit;
  char kind = 'x';
  int joint = -1;

  double size() const { return high > low ? high - low : 0.0; }
};

/// Distance that the measured velocity says was travelled, at most.
double travelled(const Recording& r, int joint) {
  if (r.qd.size() == 0) return 0.0;
  double at = 0.0, low = 0.0, high = 0.0;
  for (long i = 1; i < r.rows(); ++i) {
    const double v = r.qd(i, joint);
    if (!std::isfinite(v)) continue;
    at += v * (r.time[i] - r.time[i - 1]);
    low = std::min(low, at);
    high = std::max(high, at);
  }
  return high - low;
}

}  // namespace

void audit_dead(AuditContext& c) {
  std::map<std::string, Range> ranges;
  for_each_channel(c, [&](const ChannelView& view) {
    Range& range = ranges[view.channel];
    range.channel = view.channel;
    range.where = view.where;
    range.unit = view.unit;
    range.kind = view.kind;
    range.joint = view.joint;
    range.rows += view.values.size();
    for (const double x : view.values) {
      if (!std::isfinite(x)) continue;
      ++range.finite;
      range.low = std::min(range.low, x);
      range.high = std::max(range.high, x);
    }
    range.quantum = std::max(range.quantum, find_quantum(view.values));
  });
  const auto range_of = [&](const std::string& prefix, int joint) {
    const auto it = ranges.find(prefix + c.joints[joint].name);
    return it == ranges.end() ? 0.0 : it->second.size();
  };
  for (const auto& [name, range] : ranges) {
    ChannelFault f = make_fault("dead_channel", range.where, name, range.low + 0.0, range.unit);
    if (range.finite == 0) {
      const bool other = c.recordings.front().rows() > 0;
      // A joint without a motor has no command.
      const bool no_motor = range.joint >= 0 && !c.recordings.front().has_tau[range.joint];
      if (!other || (range.kind == 'c' && no_motor)) continue;
      f.value = 0.0;
      f.evidence = format("all %ld rows are empty", range.rows);
      c.add(std::move(f));
      continue;
    }
    if (range.joint >= 0 && range.size() == 0.0 && range.finite > 2) {
      const double q = range_of("q_", range.joint), command = range_of("qcmd_", range.joint);
      double by_velocity = 0.0;
      for (const Recording& r : c.recordings)
        by_velocity = std::max(by_velocity, travelled(r, range.joint));
      const double moves = range.kind == 'q' ? std::max(command, by_velocity) : q;
      const bool is_command = range.kind == 'c';  // a hand may guide the robot
      if (moves > kMoves && !is_command) {
        f.evidence = format("stays %.6g %s in all %ld rows while %s moves by %.3g %s", range.low,
                            range.unit.c_str(), range.finite,
                            range.kind == 'q'
                                ? (command > by_velocity ? "its command" : "its measured velocity")
                                : "the joint",
                            moves, c.position_unit(range.joint).c_str());
        if (range.kind == 't' && range.low == 0.0)
          f.evidence += "; declare the joint passive if its torque is known to be zero";
        c.add(std::move(f));
        continue;
      }
    }
    // Positions of joints that hold still take two or three values, and that is no fault.
    const bool moves = range.joint < 0 || range_of("q_", range.joint) > 0.05;
    if (range.quantum > 0.0 && moves && range.size() > 2.0 * range.quantum &&
        range.size() < kFewSteps * range.quantum) {
      f.fault = "coarse_quantisation";
      f.value = range.quantum;
      f.severity =
          range.size() < 16.0 * range.quantum ? FaultSeverity::kFault : FaultSeverity::kNote;
      f.evidence =
          format("steps of %.4g %s: its range, %.4g to %.4g, holds %.0f of them", range.quantum,
                 range.unit.c_str(), range.low, range.high, range.size() / range.quantum);
      c.add(std::move(f));
    }
  }
  c.check("dead channels", true,
          format("%zu channels: constant, empty, or of few steps", ranges.size()));
}

}  // namespace diffnea::detail
