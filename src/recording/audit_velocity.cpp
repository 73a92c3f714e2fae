/// Measured velocities and accelerations against the derivatives of the positions:
/// measured(t) = s · H(v)(t) + c, H a pure delay or a low-pass of first order.

#include <algorithm>
#include <cmath>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea::detail {
namespace {

/// Blocks of the standard errors; half a second and more each, so that their scores are
/// independent.
constexpr double kBlockSeconds = 0.5;
/// Scale errors below are those of a filter's ripple and of dq/dt on stamps that jitter.
constexpr double kSmallScale = 0.005;
/// Lags below this share of the interval are those of the stamps.
constexpr double kSmallLag = 0.1;

/// One joint's series, stretch by stretch, with a common block index.
struct Pair {
  std::vector<VecX<double>> reference, measured;
  std::vector<int> block;  ///< per row of all stretches
  double dt = 0.0;
  long rows = 0;
};

/// x(t − lag) on the grid: cubic through four neighbours, the ends held.
VecX<double> delayed(const VecX<double>& x, double lag, double dt) {
  VecX<double> out(x.size());
  const long last = x.size() - 1;
  for (long i = 0; i <= last; ++i) {
    const double at = std::clamp(static_cast<double>(i) - lag / dt, 0.0, static_cast<double>(last));
    const long k = std::clamp(static_cast<long>(at), 1L, last - 2);
    const double s = at - static_cast<double>(k);
    const double a = x[k - 1], b = x[k], c = x[k + 1], d = x[k + 2];
    out[i] = b + s * ((c - a / 3.0 - 0.5 * b - d / 6.0) +
                      s * (0.5 * (a + c) - b + s * ((d - a) / 6.0 + 0.5 * (b - c))));
  }
  return out;
}

/// x through 1/(1 + T s), exact for x linear between rows, settled at the start.
VecX<double> low_passed(const VecX<double>& x, double time_constant, double dt) {
  if (time_constant < 1e-9) return x;
  VecX<double> out(x.size());
  const double decay = std::exp(-dt / time_constant);
  double y = x[0] - (x[1] - x[0]) / dt * time_constant;
  out[0] = y;
  for (long i = 1; i < x.size(); ++i) {
    const double slope = (x[i] - x[i - 1]) / dt;
    y = x[i] - slope * time_constant + (y - x[i - 1] + slope * time_constant) * decay;
    out[i] = y;
  }
  return out;
}

using Shape = VecX<double> (*)(const VecX<double>&, double, double);

struct LagFit {
  double scale = 0.0, lag = 0.0, offset = 0.0;
  double scale_std = 0.0, lag_std = 0.0, offset_std = 0.0;
  double explained = 0.0;
  std::vector<double> block_rss;
  bool converged = false;
};

VecX<double> stacked(const std::vector<VecX<double>>& parts, long rows) {
  VecX<double> out(rows);
  long at = 0;
  for (const VecX<double>& p : parts) {
    out.segment(at, p.size()) = p;
    at += p.size();
  }
  return out;
}

/// Gauss–Newton in the lag; scale and offset are linear.
LagFit fit_lag(const Pair& pair, Shape shape, double start) {
  LagFit out;
  out.lag = start;
  const VecX<double> y = stacked(pair.measured, pair.rows);
  const bool causal = shape == &low_passed;
  BlockFit fit;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const double h = 0.05 * pair.dt;
    std::vector<VecX<double>> now, slope;
    for (const VecX<double>& v : pair.reference) {
      now.push_back(shape(v, out.lag, pair.dt));
      const double below = causal ? std::max(0.0, out.lag - h) : out.lag - h;
      slope.emplace_back((shape(v, out.lag + h, pair.dt) - shape(v, below, pair.dt)) /
                         (out.lag + h - below));
    }
    MatX<double> x(pair.rows, 3);
    x.col(0) = stacked(now, pair.rows);
    x.col(1).setOnes();
    x.col(2) = stacked(slope, pair.rows);
    fit = fit_in_blocks(x, y, pair.block);
    out.scale = fit.coefficients[0];
    out.offset = fit.coefficients[1];
    out.scale_std = fit.std[0];
    out.offset_std = fit.std[1];
    out.explained = fit.explained;
    const double step = std::abs(out.scale) > 1e-12 ? fit.coefficients[2] / out.scale : 0.0;
    out.lag_std = std::abs(out.scale) > 1e-12 ? fit.std[2] / std::abs(out.scale) : 0.0;
    double next = std::clamp(out.lag + step, -1.0, 1.0);
    if (!std::isfinite(next)) break;  // of numbers so far apart that their fit has none
    if (causal) next = std::max(0.0, next);
    out.converged = std::abs(next - out.lag) < 0.01 * pair.dt + 0.01 * out.lag_std;
    out.lag = next;
    if (out.converged) break;
  }
  out.block_rss.assign(pair.block.empty() ? 0 : static_cast<std::size_t>(pair.block.back()) + 1,
                       0.0);
  for (long i = 0; i < pair.rows; ++i)
    out.block_rss[pair.block[i]] += fit.residual[i] * fit.residual[i];
  return out;
}

/// How sure it is that `a` fits better than `b` [standard errors], negative where `b` does: the
/// likelihood ratio of as many independent draws as the low-pass leaves, 0 unless most blocks
/// agree.
double preference(const LagFit& a, const LagFit& b, double draws) {
  double sum = 0.0, square = 0.0, rss_a = 0.0, rss_b = 0.0;
  for (std::size_t k = 0; k < a.block_rss.size(); ++k) {
    const double d = b.block_rss[k] - a.block_rss[k];
    sum += d;
    square += d * d;
    rss_a += a.block_rss[k];
    rss_b += b.block_rss[k];
  }
  if (!(rss_a > 0.0 && rss_b > 0.0) || std::abs(sum) < 1.5 * std::sqrt(square)) return 0.0;
  const double ratio = draws * std::log(rss_b / rss_a);
  return std::copysign(std::sqrt(std::abs(ratio)), ratio);
}

/// What differs between the check of velocities and that of accelerations.
struct Kind {
  const char* name;
  const char* channel;
  const char* derivative;
  const char* per;  ///< of the unit
  RowMatX<double> FilteredStretch::* measured;
  RowMatX<double> FilteredStretch::* reference;
  bool twice;  ///< differentiated
};

struct Checker {
  Checker(AuditContext& context, const Kind& what, const std::vector<bool>& channels)
      : c(context), kind(what), has(channels) {
    for (const FilteredStretch& s : c.stretches)
      if ((s.*kind.measured).size() > 0) stretches.push_back(&s);
  }

  AuditContext& c;
  const Kind& kind;
  const std::vector<bool>& has;
  std::vector<const FilteredStretch*> stretches;  ///< of the recordings that have the channel

  double rms(RowMatX<double> FilteredStretch::* member, int j) const {
    double sum = 0.0, count = 0.0;
    for (const FilteredStretch* s : stretches) {
      sum += (s->*member).col(j).squaredNorm();
      count += static_cast<double>((s->*member).rows());
    }
    return std::sqrt(sum / std::max(1.0, count));
  }

  /// Rms noise of the derivative; from one differentiation to the next 2π times about the cut-off.
  double noise(int j) const {
    return c.velocity_noise[j] * (kind.twice ? 4.9 * c.plan->filter_hz : 1.0);
  }
  bool moves(int j) const {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const FilteredStretch* s : stretches) {
      low = std::min(low, s->q.col(j).minCoeff());
      high = std::max(high, s->q.col(j).maxCoeff());
    }
    return high - low > 1e-3 && rms(kind.reference, j) > 5.0 * noise(j);
  }

  double correlation(int measured, int joint) const {
    double sum = 0.0, xx = 0.0, yy = 0.0;
    for (const FilteredStretch* s : stretches) {
      const auto x = (s->*kind.reference).col(joint), y = (s->*kind.measured).col(measured);
      sum += x.dot(y);
      xx += x.squaredNorm();
      yy += y.squaredNorm();
    }
    return xx > 0.0 && yy > 0.0 ? sum / std::sqrt(xx * yy) : 0.0;
  }

  ChannelFault fault(const char* what, int j) const {
    return make_fault(std::string(kind.name) + what, c.joints[j].name,
                      kind.channel + c.joints[j].name, 0.0, "1");
  }

  /// @return false if the channel belongs to no joint, or another's
  bool belongs(int j, std::vector<bool>& reported) const {
    const double own = correlation(j, j);
    int best = j;
    double largest = std::abs(own);
    for (int i = 0; i < c.num_joints(); ++i)
      if (i != j && moves(i) && std::abs(correlation(j, i)) > largest) {
        best = i;
        largest = std::abs(correlation(j, i));
      }
    if (best != j && largest > 0.9 && std::abs(own) < 0.8) {
      const bool mutual = has[best] && std::abs(correlation(best, j)) > 0.9;
      if (mutual && reported[best]) return false;
      reported[j] = true;
      ChannelFault f = fault("_swapped", j);
      f.value = correlation(j, best);
      f.evidence = format("%s%s correlates with %s of %s by %.3f and with that of %s by %.3f",
                          kind.channel, c.joints[j].name.c_str(), kind.derivative,
                          c.joints[best].name.c_str(), f.value, c.joints[j].name.c_str(), own);
      if (mutual)
        f.evidence += format("; %s%s the other way round (%.3f): the two are swapped", kind.channel,
                             c.joints[best].name.c_str(), correlation(best, j));
      c.add(std::move(f));
      return false;
    }
    if (std::abs(own) >= 0.5) return true;
    ChannelFault f = fault("_unrelated", j);
    f.value = own;
    f.evidence = format(
        "correlates with %s by %.3f, and with that of no other joint by more than "
        "%.2f",
        kind.derivative, own, largest);
    c.add(std::move(f));
    return false;
  }

  /// @return false if there is too little to look at
  void compare(int j) const {
    Pair pair;
    pair.dt = c.plan->dt;
    int block = 0;
    for (const FilteredStretch* s : stretches) {
      if (s->time.size() < 8) continue;
      pair.reference.emplace_back((s->*kind.reference).col(j));
      pair.measured.emplace_back((s->*kind.measured).col(j));
      const double seconds =
          std::max(kBlockSeconds, static_cast<double>(s->time.size()) * c.plan->dt / 200.0);
      for (long i = 0; i < s->time.size(); ++i)
        pair.block.push_back(block +
                             static_cast<int>(static_cast<double>(i) * c.plan->dt / seconds));
      block = pair.block.back() + 1;
      pair.rows += s->time.size();
    }
    if (block < 4) return;
    const LagFit delay = fit_lag(pair, &delayed, 0.0);
    if (!delay.converged) return;
    const double z = c.limits.significance;
    if (delay.scale < 0.0) {
      ChannelFault f = fault("_sign", j);
      f.value = delay.scale;
      f.std = delay.scale_std;
      f.significance = std::abs(delay.scale) / delay.scale_std;
      f.evidence = format("is %.4g ± %.2g times %s (correlation %.3f): the sign is flipped",
                          delay.scale, delay.scale_std, kind.derivative, correlation(j, j));
      c.add(std::move(f));
    }
    const double draws = 2.0 * c.plan->filter_hz * static_cast<double>(pair.rows) * pair.dt;
    // A lag moves the scale by second order; both shapes of it are tried.
    const LagFit filter = fit_lag(pair, &low_passed, std::max(0.0, delay.lag));
    const double filter_over_delay =
        delay.lag > 0.0 && filter.converged ? preference(filter, delay, draws) : -99.0;
    const LagFit& best = filter_over_delay > 0.0 ? filter : delay;
    const double scale = std::abs(best.scale);
    const double rms_reference = rms(kind.reference, j), ratio = noise(j) / rms_reference;
    // Noise of the derivative, common to no other channel, attenuates: errors in variables.
    const double attenuation = 2.0 * ratio * ratio;
    if (std::abs(scale - 1.0) > std::max(kSmallScale + attenuation, z * best.scale_std)) {
      ChannelFault f = fault("_scale", j);
      f.value = scale;
      f.std = best.scale_std;
      f.significance = std::abs(scale - 1.0) / best.scale_std;
      f.severity = std::abs(scale - 1.0) > 0.02 ? FaultSeverity::kFault : FaultSeverity::kNote;
      f.evidence = format("is %.5g ± %.2g times %s over %.4g s", scale, best.scale_std,
                          kind.derivative, static_cast<double>(pair.rows) * pair.dt);
      constexpr double kDegrees = 57.29577951308232;
      if (std::abs(scale / kDegrees - 1.0) < 0.05) f.evidence += ": degrees (180/π = 57.3)";
      if (std::abs(scale * kDegrees - 1.0) < 0.05)
        f.evidence += ": the positions are degrees (π/180)";
      c.add(std::move(f));
    }
    const double least = kSmallLag * c.dt;
    if (std::abs(best.lag) > std::max(least, z * best.lag_std)) {
      const bool is_delay = filter_over_delay < -3.0, is_filter = filter_over_delay > 3.0;
      ChannelFault f = fault("_filter_lag", j);
      if (is_delay) f.fault = "time_shift";
      f.value = best.lag;
      f.unit = "s";
      f.std = best.lag_std;
      f.significance = std::abs(best.lag) / best.lag_std;
      // The error that the lag makes: its rate of change times the lag.
      double change = 0.0;
      for (const VecX<double>& v : pair.reference)
        change += (v.tail(v.size() - 1) - v.head(v.size() - 1)).squaredNorm();
      const double error = std::abs(best.lag) * std::sqrt(change / static_cast<double>(pair.rows)) /
                           pair.dt / rms_reference;
      f.severity = error > 0.02 ? FaultSeverity::kFault : FaultSeverity::kNote;
      f.evidence =
          format("%s %s by %.3g ± %.2g ms (%.2g rows), an error of %.2g %% of its rms",
                 best.lag > 0.0 ? "lags" : "leads", kind.derivative, 1e3 * std::abs(best.lag),
                 1e3 * best.lag_std, std::abs(best.lag) / c.dt, 100.0 * error);
      if (is_filter)
        f.evidence += format(
            "; a low-pass of first order fits better than a pure delay (by %.1f "
            "standard errors)",
            filter_over_delay);
      else if (is_delay && best.lag > 0.0)
        f.evidence += filter_over_delay < -50.0
                          ? "; a pure delay fits, a low-pass of first order does not"
                          : format(
                                "; a pure delay fits better than a low-pass of first order (by "
                                "%.1f standard errors)",
                                -filter_over_delay);
      else if (!is_delay)
        f.evidence += "; this motion cannot tell a low-pass from a pure delay";
      if (!kind.twice && std::abs(best.lag / c.dt - 0.5) < std::max(0.1, 3.0 * best.lag_std / c.dt))
        f.evidence += "; half a row is what a backward difference of the positions lags";
      c.add(std::move(f));
    }
    const double rms_measured = rms(kind.measured, j);
    if (std::abs(best.offset) > std::max(0.01 * rms_measured, z * best.offset_std)) {
      ChannelFault f = fault("_offset", j);
      f.value = best.offset;
      f.unit = c.position_unit(j) + kind.per;
      f.std = best.offset_std;
      f.significance = std::abs(best.offset) / best.offset_std;
      f.severity = std::abs(best.offset) > 0.05 * rms_measured ? FaultSeverity::kFault
                                                               : FaultSeverity::kNote;
      f.evidence =
          format("%+.4g ± %.2g %s beside %s, %.2g %% of its rms", best.offset, best.offset_std,
                 f.unit.c_str(), kind.derivative, 100.0 * std::abs(best.offset) / rms_measured);
      c.add(std::move(f));
    }
  }

  void run() const {
    const int with = static_cast<int>(std::ranges::count(has, true));
    const std::string name = std::string("measured ") + kind.name;
    if (with == 0) {
      c.check(name, false, format("there is no column %s<joint>", kind.channel));
      return;
    }
    if (stretches.empty()) {
      c.check(name, false,
              c.stretches.empty() ? c.unfiltered_reason
                                  : "no stretch of a recording that has it can be filtered");
      return;
    }
    int compared = 0;
    std::vector<bool> reported(c.num_joints(), false);
    for (int j = 0; j < c.num_joints(); ++j) {
      // A channel that is constant is dead, which is another fault.
      if (!has[j] || !moves(j) || !(rms(kind.measured, j) > 0.0)) continue;
      ++compared;
      if (belongs(j, reported)) compare(j);
    }
    c.check(
        name, compared > 0,
        compared > 0
            ? format("%d of %d joints compared with %s, both low-passed at %.3g Hz without phase",
                     compared, c.num_joints(), kind.derivative, c.plan->filter_hz)
            : std::string("no joint moves by enough"));
  }
};

}  // namespace

void audit_velocity(AuditContext& c) {
  const Kind velocity{"velocity",           "qd_", "dq/dt", "/s", &FilteredStretch::measured_qd,
                      &FilteredStretch::qd, false};
  const Kind acceleration{
      "acceleration",        "qdd_", "d²q/dt²", "/s^2", &FilteredStretch::measured_qdd,
      &FilteredStretch::qdd, true};
  Checker{c, velocity, c.has_qd}.run();
  Checker{c, acceleration, c.has_qdd}.run();
}

}  // namespace diffnea::detail
