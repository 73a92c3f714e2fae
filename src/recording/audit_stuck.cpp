/// Values that repeat: channels refreshed more slowly than rows are written, single rows that
/// repeat the one before, and stretches where a channel stands still and then jumps.

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"
#include "recording/axis_columns.hpp"

namespace diffnea::detail {
namespace {

/// A step after which the channel is called moving [quanta]: chance repeats it in 1 of 10 rows.
constexpr double kMovingSteps = 5.0;
/// Repeats below this share of the moving rows change nothing that a fit would see.
constexpr double kSmallShare = 0.002;
/// Rows of one value that are no chance, and the share of its range that a joint goes through
/// meanwhile, which no torque that is measured lasts through.
constexpr long kLeastRows = 10;
constexpr double kHalf = 0.5;

/// Steps from row to row; NaN across a gap in time or values.
std::vector<double> steps_of(const VecX<double>& x, const VecX<double>& time, double dt) {
  std::vector<double> d(static_cast<std::size_t>(x.size()),
                        std::numeric_limits<double>::quiet_NaN());
  for (long i = 1; i < x.size(); ++i)
    if (time[i] - time[i - 1] < 2.5 * dt) d[i] = x[i] - x[i - 1];
  return d;
}

struct Repeats {
  std::vector<std::string> channels;
  std::vector<long> rows;
  long moving = 0;
};

/// The rate at which the channel is refreshed, in rows; 1: every row.
double hold_length(const std::vector<double>& d, double quantum, double& share) {
  std::vector<double> runs, sizes;
  long last = -1;
  for (long i = 1; i < static_cast<long>(d.size()); ++i) {
    if (std::isnan(d[i])) last = -1;
    if (!(std::abs(d[i]) > 0.0)) continue;
    if (last >= 0) {
      runs.push_back(static_cast<double>(i - last));
      sizes.push_back(std::abs(d[i]));
    }
    last = i;
  }
  if (runs.size() < 50 || quantile(sizes, 0.5) < 2.5 * quantum) return 1.0;
  const double usual = quantile(runs, 0.5);
  double sum = 0.0, count = 0.0;
  for (const double run : runs)  // standing still is no hold
    if (run < 3.0 * usual) {
      sum += run;
      count += 1.0;
    }
  const double mean = sum / count;
  double regular = 0.0;
  for (const double run : runs)
    if (run >= std::floor(mean) && run <= std::ceil(mean)) regular += 1.0;
  share = regular / static_cast<double>(runs.size());
  return share > 0.9 && mean > 1.3 ? mean : 1.0;
}

/// Rows where the value repeats although the rows about it move, if that is no chance.
std::vector<long> repeated_rows(const std::vector<double>& d, double quantum, double significance,
                                long& moving) {
  std::vector<double> sizes;
  for (const double x : d)
    if (std::abs(x) > 0.0) sizes.push_back(std::abs(x));
  moving = 0;
  if (sizes.size() < 50) return {};
  // The finest steps, whether or not there is one quantum.
  const double unit = std::max(quantum, quantile(sizes, 0.001));
  const double moves = std::max(kMovingSteps * unit, 0.2 * quantile(sizes, 0.5));
  std::vector<long> zero;
  double fine_steps = 0.0;
  for (std::size_t i = 2; i + 1 < d.size(); ++i) {
    if (!(std::min(std::abs(d[i - 1]), std::abs(d[i + 1])) > moves)) continue;
    ++moving;
    if (d[i] == 0.0) zero.push_back(static_cast<long>(i));
    if (std::abs(d[i]) > 0.0 && std::abs(d[i]) < 4.5 * unit) fine_steps += 1.0;
  }
  // By chance a step of 0 is as frequent as any of ±1 … ±4 quanta; twice that, because channels
  // that are computed from quantised ones skip some of these.
  const double count = static_cast<double>(zero.size()), chance = 0.25 * fine_steps;
  const bool found = count >= 10.0 && count > kSmallShare * static_cast<double>(moving) + chance &&
                     count - chance > significance * std::sqrt(count + chance);
  return found ? zero : std::vector<long>{};
}

/// A torque that begins or ends with rows of one value, while its joint goes through half of its
/// range: the drive's log starts late or stops early.
void find_half_logged(const AuditContext& c, const ChannelView& view) {
  if (view.kind != 't') return;
  const Recording& r = c.recordings[view.recording];
  const VecX<double>& x = view.values;
  const auto extremes = [](const auto& values) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const double v : values)
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
    return std::pair(low, high);
  };
  const auto range_of = [&](long from, long rows) {
    const auto [low, high] = extremes(r.q.col(view.joint).segment(from, rows));
    return high > low ? high - low : 0.0;
  };
  const auto [low, high] = extremes(x);
  for (const bool ends : {false, true}) {
    const long edge = ends ? x.size() - 1 : 0, step = ends ? -1 : 1;
    long rows = 1;
    while (rows < x.size() && x[edge + step * rows] == x[edge]) ++rows;
    if (rows < kLeastRows || rows == x.size()) continue;
    const long from = ends ? x.size() - rows : 0;
    // A drive at its limit says so, which is no fault of the log.
    if (x[edge] != 0.0 && (x[edge] == low || x[edge] == high)) continue;
    const double moves = range_of(from, rows);
    if (!(moves > kHalf * range_of(0, x.size()))) continue;
    ChannelFault f = make_fault("frozen_channel", view.where, view.channel,
                                r.time[from + rows - 1] - r.time[from], "s");
    f.source = r.source;
    f.evidence = format(
        "stays %.6g %s in the %s %ld rows, %s t = %.6g s, while the joint moves by %.3g %s: leave "
        "these cells empty if the torque was not recorded there",
        x[edge], view.unit.c_str(), ends ? "last" : "first", rows, ends ? "from" : "up to",
        r.time[ends ? from : rows - 1], moves, c.position_unit(view.joint).c_str());
    c.add(std::move(f));
  }
}

void find_frozen(const AuditContext& c, const ChannelView& view, const std::vector<double>& d) {
  std::vector<double> sizes, runs;
  for (const double x : d)
    if (std::abs(x) > 0.0) sizes.push_back(std::abs(x));
  if (sizes.size() < 50) return;
  const double large = quantile(sizes, 0.99), fine = 3.0 * quantile(sizes, 0.001);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double x : view.values)
    if (std::isfinite(x)) {
      low = std::min(low, x);
      high = std::max(high, x);
    }
  long run = 0, longest = 0, end = 0, count = 0;
  for (long i = 1; i < static_cast<long>(d.size()); ++i) {
    if (d[i] == 0.0) {
      ++run;
      continue;
    }
    // Ten rows of standing still that end with more than rows ever move by.
    bool jumps = std::abs(d[i]) > 4.0 * large && run >= 10;
    // A joint that rested and is pushed was resting before: a frozen channel moved.
    int moved = 0;
    for (long k = std::max(1L, i - run - 5); k < i - run; ++k)
      if (std::abs(d[k]) > fine) ++moved;
    const double held = view.values[i - 1];  // at the extreme it is clipped
    jumps = jumps && moved >= 3 && held > low && held < high;
    if (jumps) {
      ++count;
      if (run > longest) {
        longest = run;
        end = i;
      }
    } else if (run > 0) {
      runs.push_back(static_cast<double>(run));
    }
    run = 0;
  }
  if (count == 0) return;
  const Recording& r = c.recordings[view.recording];
  const double seconds = r.time[end - 1] - r.time[end - 1 - longest];
  ChannelFault f = make_fault("frozen_channel", view.where, view.channel, seconds, "s");
  f.source = r.source;
  f.evidence = format(
      "stands still %ld time%s and then jumps; the longest, %.3g s up to t = %.6g s, "
      "ends with %+.4g %s, where 99 %% of the steps are below %.3g",
      count, count == 1 ? "" : "s", seconds, r.time[end - 1], d[end], view.unit.c_str(), large);
  c.add(std::move(f));
}

}  // namespace

void audit_stuck(AuditContext& c) {
  // Rows that repeat in several channels at once are one fault: group those that agree.
  std::map<std::size_t, std::vector<Repeats>> groups;
  std::map<std::size_t, std::map<double, std::vector<std::string>>>
      held;  // rows per value → channels
  std::map<std::string, double> shares;
  for_each_channel(c, [&](const ChannelView& view) {
    const Recording& r = c.recordings[view.recording];
    if (r.rows() < 100 || view.kind == 'c') return;  // commands come from slower planners
    const std::vector<double> d = steps_of(view.values, r.time, c.dt);
    const double quantum = find_quantum(view.values);
    double share = 0.0;
    const double hold = hold_length(d, quantum, share);
    if (hold > 1.0) {
      held[view.recording][std::round(100.0 * hold) / 100.0].push_back(view.channel);
      shares[view.channel] = share;
      return;
    }
    find_frozen(c, view, d);
    find_half_logged(c, view);
    long moving = 0;
    const std::vector<long> rows = repeated_rows(d, quantum, c.limits.significance, moving);
    if (rows.empty()) return;
    for (Repeats& group : groups[view.recording]) {
      std::vector<long> common;
      std::ranges::set_intersection(rows, group.rows, std::back_inserter(common));
      if (static_cast<double>(common.size()) <
          0.6 * static_cast<double>(std::min(rows.size(), group.rows.size())))
        continue;
      group.channels.push_back(view.channel);
      if (rows.size() > group.rows.size()) {
        group.rows = rows;
        group.moving = moving;
      }
      return;
    }
    groups[view.recording].push_back({{view.channel}, rows, moving});
  });
  const auto name = [](const std::vector<std::string>& channels) {
    std::string out;
    for (const std::string& channel : channels) out += (out.empty() ? "" : ", ") + channel;
    return out;
  };
  const auto where = [&](const std::vector<std::string>& channels) -> std::string {
    std::string out;
    for (const std::string& channel : channels) {
      const std::string joint = channel.substr(channel.find('_') + 1);
      if (!out.empty() && out != joint) return "all";
      out = joint;
    }
    for (const AxisColumns& of : kAxisColumns)
      for (std::size_t axis = 0; axis < of.axes.size(); ++axis)
        if (channels.front() == of.column(axis)) return std::string(of.where);
    return out;
  };
  for (const auto& [k, by_hold] : held)
    for (const auto& [hold, channels] : by_hold) {
      ChannelFault f =
          make_fault("sample_and_hold", where(channels), name(channels), 1.0 / (hold * c.dt), "Hz");
      f.source = c.recordings[k].source;
      f.evidence = format(
          "refreshed every %.3g rows (%.0f %% of the changes are that far apart): at "
          "%.4g Hz, while rows come at %.4g Hz",
          hold, 100.0 * shares[channels.front()], 1.0 / (hold * c.dt), 1.0 / c.dt);
      c.add(std::move(f));
    }
  for (const auto& [k, list] : groups)
    for (const Repeats& group : list) {
      const double share =
          static_cast<double>(group.rows.size()) / static_cast<double>(group.moving);
      ChannelFault f =
          make_fault("stuck_samples", where(group.channels), name(group.channels), share, "1");
      f.std = std::sqrt(share * (1.0 - share) / static_cast<double>(group.moving));
      f.significance = share / f.std;
      f.severity = share > 0.2 ? FaultSeverity::kFault : FaultSeverity::kNote;
      f.source = c.recordings[k].source;
      f.evidence = format(
          "%zu rows repeat the value before while the rows about them move (%.2g %% "
          "of those that move), the first at t = %.6g s: samples that came late",
          group.rows.size(), 100.0 * share, c.recordings[k].time[group.rows.front()]);
      c.add(std::move(f));
    }
  c.check("repeated samples", true, "values that stay while rows go on");
}

}  // namespace diffnea::detail
