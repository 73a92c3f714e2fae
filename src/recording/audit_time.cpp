/// The clock: missing rows, jitter, a rate that changes.

#include <algorithm>
#include <cmath>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"
#include "recording/time_unit.hpp"

namespace diffnea::detail {
namespace {

/// From here on rows are missing, not late: an interval that could hold two more rows [intervals].
constexpr double kGap = 2.5;
/// Jitter below is no concern: at f = rate/10 it is noise of 0.6 % of the motion.
constexpr double kSmallJitter = 0.02;
/// Of the mean interval; below, masses and frictions move by less than their usual errors.
constexpr double kSmallRateChange = 0.003;

void find_gaps(const AuditContext& c, const Recording& r, const std::vector<double>& steps,
               double dt) {
  // Longer pauses are cut out, which costs their surroundings and nothing else; shorter ones are
  // interpolated.
  const double cut = c.plan ? c.plan->max_gap * c.plan->dt : 5.0 * dt;
  long gaps = 0, missing = 0, bridged = 0, cuts = 0;
  double longest = 0.0, at = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i] < kGap * dt) continue;
    ++gaps;
    const long rows = std::lround(steps[i] / dt) - 1;
    missing += rows;
    if (steps[i] > cut)
      ++cuts;
    else
      bridged += rows;
    if (steps[i] <= longest) continue;
    longest = steps[i];
    at = r.time[static_cast<long>(i)];
  }
  if (gaps == 0) return;
  ChannelFault f = make_fault("time_gap", "time", "time", longest, "s");
  const double share = static_cast<double>(bridged) / static_cast<double>(r.rows() + bridged);
  f.severity = share > 0.05 ? FaultSeverity::kFault : FaultSeverity::kNote;
  f.source = r.source;
  f.evidence = format(
      "%ld pause%s where about %ld rows of %.4g ms are missing, or the clock jumps; the "
      "longest, %.4g s, follows t = %.6g s; ",
      gaps, gaps == 1 ? "" : "s", missing, 1e3 * dt, longest, at);
  f.evidence += cuts == gaps ? std::string("the motion is cut there")
                             : format("%ld of them are interpolated, %.2g %% of the rows",
                                      gaps - cuts, 100.0 * share);
  c.add(std::move(f));
}

/// All times are multiples of this [s]; 0: finer than 1 µs.
double stamp_resolution(const VecX<double>& time) {
  for (const double step : {0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4, 1e-5}) {
    long off = 0;
    for (long i = 0; i < time.size(); ++i) {
      const double n = (time[i] - time[0]) / step;
      if (std::abs(n - std::nearbyint(n)) > 0.02) ++off;
    }
    if (off <= time.size() / 1000) return step;
  }
  return 0.0;
}

void find_jitter(const AuditContext& c, const Recording& r, const std::vector<double>& regular) {
  double mean = 0.0, square = 0.0;
  for (const double s : regular) mean += s / static_cast<double>(regular.size());
  for (const double s : regular) square += (s - mean) * (s - mean);
  const double rms = std::sqrt(square / static_cast<double>(regular.size()));
  if (!(rms > kSmallJitter * mean)) return;
  const auto [shortest, longest] = std::ranges::minmax(regular);
  ChannelFault f = make_fault("time_jitter", "time", "time", rms, "s");
  f.std = rms / std::sqrt(2.0 * static_cast<double>(regular.size()));
  f.significance = rms / f.std;
  // Stamps that jitter while the samples do not turn into noise of q̇: share of its size.
  f.severity = rms > 0.2 * mean ? FaultSeverity::kFault : FaultSeverity::kNote;
  f.source = r.source;
  f.evidence = format(
      "intervals of %.4g ms on average vary by %.3g ms rms (%.2g %%), from %.4g to "
      "%.4g ms",
      1e3 * mean, 1e3 * rms, 100.0 * rms / mean, 1e3 * shortest, 1e3 * longest);
  const double step = stamp_resolution(r.time);
  // Rounding both stamps of an interval: p(1−p) of the step squared, p the share that is rounded
  // up.
  const double part = step > 0.0 ? mean / step - std::floor(mean / step) : 0.0;
  if (step * std::sqrt(part * (1.0 - part)) > 0.7 * rms)
    f.evidence += format("; the stamps are multiples of %.3g ms, which explains it", 1e3 * step);
  c.add(std::move(f));
}

/// The split of the intervals into before and after whose means differ most.
void find_rate_change(const AuditContext& c, const Recording& r,
                      const std::vector<double>& regular) {
  // Stamps that jitter about a true clock make neighbours' errors cancel: means of blocks know
  // that.
  const long num_blocks = 40, size = static_cast<long>(regular.size()) / num_blocks;
  if (size < 5) return;
  std::vector<double> block(num_blocks, 0.0);
  for (long b = 0; b < num_blocks; ++b)
    for (long i = 0; i < size; ++i) block[b] += regular[b * size + i] / static_cast<double>(size);
  double best = 0.0, before = 0.0, after = 0.0, noise = 0.0;
  long split = 0;
  for (long k = 3; k + 3 <= num_blocks; ++k) {
    double left = 0.0, right = 0.0, rss = 0.0;
    for (long b = 0; b < num_blocks; ++b) (b < k ? left : right) += block[b];
    left /= static_cast<double>(k);
    right /= static_cast<double>(num_blocks - k);
    for (long b = 0; b < num_blocks; ++b) {
      const double d = block[b] - (b < k ? left : right);
      rss += d * d;
    }
    const double std =
        std::sqrt(rss / static_cast<double>(num_blocks - 2) *
                  (1.0 / static_cast<double>(k) + 1.0 / static_cast<double>(num_blocks - k)));
    const double z = std::abs(right - left) / std::max(std, 1e-6 * left);
    if (z <= best) continue;
    best = z;
    before = left;
    after = right;
    noise = std;
    split = k * size;
  }
  const double change = after / before - 1.0;
  // One of 35 splits is chosen: two standard errors more than for a single test.
  if (!(best > c.limits.significance + 2.0 && std::abs(change) > kSmallRateChange)) return;
  ChannelFault f = make_fault("time_rate_change", "time", "time", change, "1");
  f.std = noise / before;
  f.significance = best;
  // Stamps that are right are resampled: a small change alone does no harm.
  f.severity = std::abs(change) > 0.02 ? FaultSeverity::kFault : FaultSeverity::kNote;
  f.source = r.source;
  f.evidence = format(
      "intervals are %.6g ms long up to about t = %.5g s and %.6g ms after it "
      "(%+.3g %%): two rates, or a clock that drifts",
      1e3 * before, r.time[std::min(split, r.rows() - 1)], 1e3 * after, 100.0 * change);
  c.add(std::move(f));
}

/// Rows of a robot are milliseconds apart.
void find_unit(AuditContext& c, const Recording& r, double dt) {
  std::string question = time_unit_question(r.time, dt);
  if (question.empty()) return;
  ChannelFault f = make_fault("time_unit", "time", "time", dt, "s");
  f.source = r.source;
  f.evidence = std::move(question);
  c.add(std::move(f));
}

}  // namespace

void audit_time(AuditContext& c) {
  long looked_at = 0;
  for (const Recording& r : c.recordings) {
    if (r.rows() < 3) continue;
    std::vector<double> steps, regular;
    for (long i = 1; i < r.rows(); ++i) steps.push_back(r.time[i] - r.time[i - 1]);
    const double dt = quantile(steps, 0.5);
    for (const double s : steps)
      if (s < kGap * dt) regular.push_back(s);
    find_unit(c, r, dt);
    find_gaps(c, r, steps, dt);
    if (regular.size() < 20) continue;
    find_jitter(c, r, regular);
    find_rate_change(c, r, regular);
    looked_at += r.rows() - 1;
  }
  c.check("time", looked_at > 0,
          looked_at > 0
              ? format("%ld intervals of %.4g ms; a clock that is wrong throughout by one "
                       "factor cannot be seen without another clock",
                       looked_at, 1e3 * c.dt)
              : "too few rows to know the usual interval");
}

}  // namespace diffnea::detail
