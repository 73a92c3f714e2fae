#include "recording/command_lag.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/statistics.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea::detail {
namespace {

/// Longest lag that is looked for, either way [s]: a soft hobby servo lags by 0.15 s.
constexpr double kLongest = 0.4;
/// Length of a block: more than the lags that are looked for, both ways [s].
constexpr double kBlock = 1.0;
/// Time over which rates are taken [s].
constexpr double kRate = 0.1;
constexpr int kFewestBlocks = 5;
/// Correlation from which a position follows its command at all.
constexpr double kFollows = 0.5;
/// Standard error of a median, times √n, over the median deviation: 1.253 · 1.483, of normal
/// numbers.
constexpr double kMedianStd = 1.858;
/// Share of what a lag leaves unexplained that an earlier position must leave: periodic motions
/// correlate a period earlier as well.
constexpr double kExplains = 0.5;

/// Correlation of y against x, y taken `shift` rows later, over rows [from, to).
double correlation(const VecX<double>& x, const VecX<double>& y, long from, long to, long shift) {
  const VecX<double> a = x.segment(from, to - from), b = y.segment(from + shift, to - from);
  const VecX<double> da = a.array() - a.mean(), db = b.array() - b.mean();
  const double size = da.norm() * db.norm();
  return size > 0.0 ? da.dot(db) / size : 0.0;
}

/// A shift with its correlation.
struct Peak {
  double shift = 0.0;  ///< [rows]
  double correlation = -1.0;
  bool inside = false;  ///< between its neighbours, not at the end of the range
};

/// The largest of equidistant correlations, to a fraction of a row by a parabola: a row beside the
/// peak of a fast motion explains less than the peak.
Peak peak_of(const std::vector<double>& c, long from, long to, long zero) {
  const auto best = std::max_element(c.begin() + from, c.begin() + to);
  const long k = best - c.begin();
  Peak out{static_cast<double>(k - zero), *best, k > 0 && k + 1 < static_cast<long>(c.size())};
  if (!out.inside) return out;
  const double left = *(best - 1), right = *(best + 1), curve = left - 2.0 * *best + right;
  if (!(curve < 0.0) || left > *best || right > *best) return out;
  out.shift += 0.5 * (left - right) / curve;
  out.correlation -= 0.125 * (left - right) * (left - right) / curve;
  return out;
}

/// Lag of one block in rows; none if nothing follows.
std::optional<double> lag_of_block(const VecX<double>& command, const VecX<double>& position,
                                   long from, long to, long most) {
  std::vector<double> by_shift;
  for (long shift = -most; shift <= most; ++shift)
    by_shift.push_back(correlation(command, position, from, to, shift));
  const long causal = most - 1;  // a row early is none
  const Peak after = peak_of(by_shift, causal, 2 * most + 1, most),
             before = peak_of(by_shift, 0, causal, most);
  const auto unexplained = [](const Peak& p) { return 1.0 - p.correlation * p.correlation; };
  const bool is_early = before.correlation > after.correlation &&
                        unexplained(before) < kExplains * unexplained(after);
  const Peak& best = is_early ? before : after;
  if (!(best.correlation > kFollows) || !best.inside) return std::nullopt;
  return best.shift;
}

}  // namespace

std::optional<CommandLag> find_command_lag(const std::vector<Recording>& recordings, int joint) {
  std::vector<double> steps, lags;
  double rough_q = 0.0, rough_command = 0.0;
  for (const Recording& r : recordings)
    for (long i = 1; i < r.rows(); ++i) steps.push_back(r.time[i] - r.time[i - 1]);
  CommandLag out;
  out.dt = median(steps);
  if (!(out.dt > 0.0) || out.dt > kLongest) return std::nullopt;
  const long most = std::max(2L, std::lround(kLongest / out.dt));
  const long length = std::max(2 * most, std::lround(kBlock / out.dt));
  for (const Recording& r : recordings) {
    if (r.qcmd.cols() <= joint || r.q.cols() <= joint || r.rows() < 2 * most + length) continue;
    // The rate, whatever the offset between both; over as long as a drive takes to follow a step.
    const long n = r.rows() - std::max(2L, std::lround(kRate / out.dt));
    const VecX<double> q = r.q.col(joint), command = r.qcmd.col(joint);
    if (!command.array().isFinite().any()) continue;
    VecX<double> rate_q = q.tail(n) - q.head(n), rate_command = command.tail(n) - command.head(n);
    for (VecX<double>* rate : {&rate_q, &rate_command})
      for (double& x : *rate)
        if (!std::isfinite(x)) x = 0.0;
    for (long i = 1; i < n; ++i) {
      rough_q += std::pow(rate_q[i] - rate_q[i - 1], 2);
      rough_command += std::pow(rate_command[i] - rate_command[i - 1], 2);
    }
    for (long from = most; from + length + most <= n; from += length)
      if (const auto lag = lag_of_block(rate_command, rate_q, from, from + length, most))
        lags.push_back(*lag);
  }
  if (static_cast<int>(lags.size()) < kFewestBlocks) return std::nullopt;
  // The median: a fast motion correlates as well a period off, in some blocks.
  const double blocks = static_cast<double>(lags.size()), middle = median(lags);
  for (double& lag : lags) lag = std::abs(lag - middle);
  out.seconds = out.dt * middle;
  out.std = out.dt * kMedianStd * median(std::move(lags)) / std::sqrt(blocks);
  out.roughness = rough_command > 0.0 ? std::sqrt(rough_q / rough_command)
                                      : std::numeric_limits<double>::infinity();
  return out;
}

std::string early_text(const CommandLag& lag, const std::string& joint) {
  const char* name = joint.c_str();
  if (lag.is_swapped())
    return format(
        "q_%s moves %.3g ± %.2g ms before qcmd_%s and is the rougher of both (%.3g times, "
        "by second differences), while a drive smooths what it is told: the columns are "
        "exchanged; --map \"q_%s=qcmd_%s,qcmd_%s=q_%s\" puts them right",
        name, -1e3 * lag.seconds, 1e3 * lag.std, name, lag.roughness, name, name, name, name);
  return format(
      "q_%s moves %.3g ± %.2g ms before qcmd_%s: no drive answers what it is not told "
      "yet; the command is stamped too late, or the columns are exchanged (then --map "
      "\"q_%s=qcmd_%s,qcmd_%s=q_%s\")",
      name, -1e3 * lag.seconds, 1e3 * lag.std, name, name, name, name, name);
}

}  // namespace diffnea::detail
