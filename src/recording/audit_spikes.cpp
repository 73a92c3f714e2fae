/// Isolated values far off their neighbours.

#include <algorithm>
#include <cmath>
#include <limits>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea::detail {
namespace {

/// Height over what 99 % of the rows show by noise and curvature; Gaussian noise reaches twice
/// that.
constexpr double kHigh = 5.0;
/// Share of the channel's variance from which least squares feel them.
constexpr double kLoud = 1e-3;
/// More of them are no outliers but how the channel is.
constexpr double kFewSpikes = 0.01;

/// A joint that moves by less is at rest [rad, m].
constexpr double kRests = 0.05;

double range_of(const VecX<double>& x) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double v : x)
    if (std::isfinite(v)) {
      low = std::min(low, v);
      high = std::max(high, v);
    }
  return high - low;
}

}  // namespace

void audit_spikes(AuditContext& c) {
  for_each_channel(c, [&](const ChannelView& view) {
    const Recording& r = c.recordings[view.recording];
    const VecX<double>& x = view.values;
    if (x.size() < 50 || view.kind == 'c') return;
    const auto joined = [&](long from, long to) {
      return r.time[to] - r.time[from] < 1.5 * c.dt * static_cast<double>(to - from);
    };
    std::vector<double> bend;
    for (long i = 1; i + 1 < x.size(); ++i) {
      const double b = std::abs(x[i - 1] - 2.0 * x[i] + x[i + 1]);
      if (std::isfinite(b) && joined(i - 1, i + 1)) bend.push_back(0.5 * b);
    }
    if (bend.size() < 50) return;
    const double usual = std::max(quantile(bend, 0.99), find_quantum(x));
    if (!(usual > 0.0)) return;
    long count = 0, at = 0;
    double highest = 0.0, energy = 0.0;
    for (long i = 1; i + 1 < x.size(); ++i)
      for (const long width : {1L, 2L}) {
        const long after = i + width;
        if (after >= x.size() || !joined(i - 1, after)) continue;
        const double up = x[i] - x[i - 1], down = x[after - 1] - x[after];
        if (!(up * down > 0.0)) continue;
        const double height = std::min(std::abs(up), std::abs(down));
        // Back to where it was: a step is no spike.
        if (!(height > kHigh * usual) || std::abs(x[after] - x[i - 1]) > 0.5 * height) continue;
        ++count;
        energy += static_cast<double>(width) * height * height;
        if (height > std::abs(highest)) {
          highest = std::copysign(height, up);
          at = i;
        }
        break;
      }
    if (count == 0 || static_cast<double>(count) > kFewSpikes * static_cast<double>(x.size()))
      return;
    ChannelFault f = make_fault("spike", view.where, view.channel, highest, view.unit);
    f.std = usual / 2.3;  // of what the rows about show: their 99 % is 2.3 standard deviations
    f.significance = std::abs(highest) / f.std;
    double mean = 0.0, square = 0.0, rows = 0.0;
    for (const double v : x)
      if (std::isfinite(v)) {
        rows += 1.0;
        mean += v;
        square += v * v;
      }
    const double share = energy / std::max(square - mean * mean / rows, 1e-300);
    // Where the joint rests, hardly anything is most of the variance.
    const bool rests = view.joint >= 0 && range_of(r.q.col(view.joint)) < kRests;
    f.severity = share > kLoud && !rests ? FaultSeverity::kFault : FaultSeverity::kNote;
    f.source = r.source;
    f.evidence = format(
        "%ld isolated value%s; the largest, at t = %.6g s, stands %+.4g %s off its "
        "neighbours, where 99 %% of the rows stay within %.3g; %.2g %% of the variance",
        count, count == 1 ? "" : "s", r.time[at], highest, view.unit.c_str(), usual, 100.0 * share);
    c.add(std::move(f));
  });
  c.check("spikes", true, "one or two rows that stand off and return");
}

}  // namespace diffnea::detail
