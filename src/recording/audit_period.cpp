/// Whether a motion repeats, and whether the sidecar says so rightly.

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea {
namespace {

using namespace detail;

/// Rows of the coarse search.
constexpr long kSearchRows = 1500;
/// Rms difference of two periods that still counts as a repetition, over √2 times the motion's
/// rms.
constexpr double kRepeats = 0.03;
/// Of a period: what the second of two may lack, its last row or what noise makes of the period.
constexpr double kShort = 1e-3;

/// Positions on a uniform grid, each joint without its mean and divided by its standard deviation.
struct Motion {
  double dt = 0.0;
  RowMatX<double> x;
};

/// Mean square of x(t + shift) − x(t) per joint and row; a shift between rows is interpolated.
double mismatch(const Motion& m, double seconds) {
  const double rows = seconds / m.dt;
  const long whole = static_cast<long>(rows), n = m.x.rows() - whole - 1;
  const double part = rows - static_cast<double>(whole);
  if (n < 2) return std::numeric_limits<double>::infinity();
  const RowMatX<double> d = (1.0 - part) * m.x.middleRows(whole, n) +
                            part * m.x.middleRows(whole + 1, n) - m.x.topRows(n);
  return d.squaredNorm() / (static_cast<double>(d.size()) + 1e-300);
}

/// @param command  the desired positions, where they are recorded, else the measured ones; joints
///                 without a motor go their own way
Motion motion_of(const Recording& r, bool command) {
  std::vector<long> joints;
  for (long j = 0; j < r.num_joints(); ++j)
    if (std::ranges::find(r.info.passive, r.joint_names[j]) == r.info.passive.end())
      joints.push_back(j);
  RowMatX<double> q = r.q(Eigen::all, joints);
  if (command && r.qcmd.size() > 0) {
    const RowMatX<double> desired = r.qcmd(Eigen::all, joints);
    if (desired.allFinite()) q = desired;
  }

  Motion out;
  const long n = q.cols();
  if (r.rows() < 20 || n == 0) return out;
  std::vector<double> steps;
  for (long i = 1; i < r.rows(); ++i) steps.push_back(r.time[i] - r.time[i - 1]);
  const double dt = quantile(steps, 0.5);
  // Lines between the measured rows, over the longest stretch whose pauses are short.
  long best_from = 0, best_to = 0;
  const auto gap = [&](long i) {
    return r.time[i] - r.time[i - 1] > std::max(0.1, 5.0 * dt) || !q.row(i).allFinite();
  };
  for (long from = 0, i = 1; i <= r.rows(); ++i)
    if (i == r.rows() || gap(i)) {
      if (i - from > best_to - best_from) {
        best_from = from;
        best_to = i;
      }
      from = i;
    }
  while (best_from < best_to && !q.row(best_from).allFinite()) ++best_from;
  if (best_to - best_from < 20) return out;
  const double t0 = r.time[best_from], seconds = r.time[best_to - 1] - t0;
  const long rows = best_to - best_from;
  out.dt = seconds / static_cast<double>(rows - 1);
  out.x.resize(rows, n);
  long k = best_from;
  for (long i = 0; i < rows; ++i) {
    const double t = t0 + static_cast<double>(i) * out.dt;
    while (k + 2 < best_to && r.time[k + 1] < t) ++k;
    const double s = std::clamp((t - r.time[k]) / (r.time[k + 1] - r.time[k]), 0.0, 1.0);
    out.x.row(i) = (1.0 - s) * q.row(k) + s * q.row(k + 1);
  }
  // Joints that hold still say nothing: they would be noise of size one.
  std::vector<long> moving;
  for (long j = 0; j < n; ++j) {
    out.x.col(j).array() -= out.x.col(j).mean();
    const double std = std::sqrt(out.x.col(j).squaredNorm() / static_cast<double>(rows));
    if (std < 2e-3) continue;
    out.x.col(j) /= std;
    moving.push_back(j);
  }
  out.x = RowMatX<double>(out.x(Eigen::all, moving));
  return out;
}

Motion thinned(const Motion& m) {
  const long factor = std::max(1L, m.x.rows() / kSearchRows);
  Motion out;
  out.dt = m.dt * static_cast<double>(factor);
  out.x.resize(m.x.rows() / factor, m.x.cols());
  for (long i = 0; i < out.x.rows(); ++i) out.x.row(i) = m.x.row(i * factor);
  return out;
}

}  // namespace

Period detect_period(const Recording& recording) {
  Period none;
  const Motion full = motion_of(recording, false);
  if (full.x.size() == 0) return none;
  const Motion coarse = thinned(full);
  const long rows = coarse.x.rows();
  // Two periods and no more are enough: their lag is half of the rows, and a minimum has
  // neighbours.
  std::vector<double> d(rows / 2 + 3, 0.0);
  for (long k = 1; k < static_cast<long>(d.size()); ++k)
    d[k] = mismatch(coarse, static_cast<double>(k) * coarse.dt);
  // Until positions have moved apart, they only look like themselves.
  long from = 1;
  while (from < static_cast<long>(d.size()) && d[from] < 0.5) ++from;
  const double seconds = static_cast<double>(full.x.rows() - 1) * full.dt;
  for (long k = from + 1; k + 1 < static_cast<long>(d.size()); ++k) {
    if (!(d[k] <= d[k - 1] && d[k] <= d[k + 1])) continue;
    // Between two rows of the coarse grid a fast motion has moved on by at most half a step.
    const double slack = 0.25 * std::max(d[k - 1] - d[k], d[k + 1] - d[k]);
    if (d[k] - slack > 2.0 * kRepeats * kRepeats) continue;
    // Parabola through the mismatch at full rate, closer and closer.
    double at = static_cast<double>(k) * coarse.dt, step = 0.5 * coarse.dt;
    for (int i = 0; i < 40 && step > 1e-3 * full.dt; ++i) {
      const double a = mismatch(full, at - step), b = mismatch(full, at),
                   c = mismatch(full, at + step);
      const double curvature = a - 2.0 * b + c;
      if (curvature > 0.0) at += std::clamp(0.5 * step * (a - c) / curvature, -step, step);
      step *= 0.6;
    }
    const double left = mismatch(full, at);
    if (!(left < 2.0 * kRepeats * kRepeats)) continue;  // 2: the variance of a difference
    if (2.0 * at > seconds + std::max(2.0 * full.dt, kShort * at)) continue;
    Period out;
    out.seconds = at;
    out.repeats = seconds / at;
    out.mismatch = std::sqrt(0.5 * left);
    // Noise of the difference over its slope, one independent draw per tenth of a second.
    const double h = 2.0 * full.dt, n = static_cast<double>(full.x.rows());
    double slope = 0.0;
    for (long i = 2; i + 2 < full.x.rows(); ++i)
      slope += (full.x.row(i + 2) - full.x.row(i - 2)).squaredNorm() / (4.0 * h * h);
    slope /= n * static_cast<double>(full.x.cols());
    const double draws = std::max(1.0, (seconds - at) / std::max(0.1, full.dt));
    out.std = std::sqrt(left / (slope * draws * static_cast<double>(full.x.cols())));
    return out;
  }
  return none;
}

namespace detail {

void audit_period(AuditContext& c) {
  int periodic = 0;
  for (const Recording& r : c.recordings) {
    const Period found = detect_period(r);
    c.report.periods.push_back(found);
    bool repeats = found.seconds > 0.0;
    const double stated = r.info.period;
    if (stated <= 0.0) {
      periodic += repeats;
      continue;
    }
    const Motion motion = motion_of(r, true);
    const double seconds = static_cast<double>(motion.x.rows()) * motion.dt;
    if (motion.x.size() == 0 || seconds < 2.0 * stated) {
      periodic += repeats;
      c.check("stated period", false,
              format("%s: %.4g s of motion hold less than two of the stated periods of %.4g s",
                     r.source.c_str(), seconds, stated));
      continue;
    }
    const double left = std::sqrt(0.5 * mismatch(motion, stated));
    const double multiple = found.seconds > 0.0 ? stated / found.seconds : 0.0;
    c.check("stated period", true,
            format("%s: after %.6g s the motion differs by %.2g %% of the motion", r.source.c_str(),
                   stated, 100.0 * left));
    repeats = repeats || left < kRepeats;  // too few periods to be found, enough to be confirmed
    periodic += repeats;
    // Where the motion does repeat, the stated period must do as well as the one found.
    if (left < kRepeats && (found.seconds == 0.0 || left < 2.0 * found.mismatch + 1e-3 ||
                            std::abs(multiple - std::nearbyint(multiple)) * found.seconds <
                                5.0 * found.std * multiple))
      continue;
    ChannelFault f = make_fault("period", "time", "time", stated, "s");
    f.source = r.source;
    f.evidence = format(
        "the sidecar says %.6g s, after which the motion differs by %.2g %% of the "
        "motion; ",
        stated, 100.0 * left);
    f.evidence += found.seconds > 0.0 ? format("they repeat every %.6g ± %.2g s (to %.2g %%)",
                                               found.seconds, found.std, 100.0 * found.mismatch)
                                      : std::string("no other period repeats either");
    c.add(std::move(f));
  }
  if (c.num_joints() > 0)
    c.check("period", true, format("%d of %zu recordings repeat", periodic, c.recordings.size()));
}

}  // namespace detail
}  // namespace diffnea
