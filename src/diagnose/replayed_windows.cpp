#include "diagnose/replayed_windows.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/stepping.hpp>
#include <diffnea/sim/replay.hpp>

#include "core/constants.hpp"
#include "core/statistics.hpp"

namespace diffnea {
namespace {

constexpr double kBefore = 0.5;  ///< [s] that effects with memory look back
constexpr long kMargin = 12;     ///< rows of the grid beyond the window: clocks are late by some ms

/// Positions of one joint on the grid: straight between those that were measured, held beyond.
void fill(const MotionStretch& s, long joint, double start, double dt,
          Eigen::Ref<VecX<double>> out) {
  const long m = std::ssize(s.time);
  long next = 0, last = -1;
  const auto skip = [&] {
    while (next < m && std::isnan(s.q(next, joint))) ++next;
  };
  skip();
  for (long k = 0; k < out.size(); ++k) {
    const double t = start + static_cast<double>(k) * dt;
    while (next < m && s.time[next] <= t) {
      last = next++;
      skip();
    }
    if (last < 0 || next >= m) {
      out[k] = last >= 0 ? s.q(last, joint) : next < m ? s.q(next, joint) : 0.0;
      continue;
    }
    const double t0 = s.time[last], t1 = s.time[next];
    out[k] = s.q(last, joint) + (t - t0) / (t1 - t0) * (s.q(next, joint) - s.q(last, joint));
  }
}

/// Torque of a stretch at a time; held beyond its ends.
Eigen::RowVectorXd torque_at(const MotionStretch& s, double t) {
  const long k = std::upper_bound(s.time.begin(), s.time.end(), t) - s.time.begin() - 1;
  const long m = std::ssize(s.time);
  if (k < 0) return s.u.row(0);
  if (k + 1 >= m) return s.u.row(m - 1);
  const double t0 = s.time[k], a = (t - t0) / (s.time[k + 1] - t0);
  return (1.0 - a) * s.u.row(k) + a * s.u_end.row(k);
}

/// Value of a column between rows: the cubic through the four around.
double between(const Eigen::Ref<const VecX<double>>& f, double at) {
  const long m = f.size();
  if (m < 4) return f[std::clamp<long>(std::lround(at), 0, m - 1)];
  const long k = std::clamp<long>(static_cast<long>(std::floor(at)) - 1, 0, m - 4);
  double out = 0.0;
  for (long i = 0; i < 4; ++i) {
    double w = 1.0;
    for (long j = 0; j < 4; ++j)
      if (j != i) w *= (at - static_cast<double>(k + j)) / static_cast<double>(i - j);
    out += w == 0.0 ? 0.0 : w * f[k + i];  // a blow-up beyond a row is not the row's
  }
  return out;
}

}  // namespace

bool needs_replay(const ExtendedTree& model) {
  // A replay knows no commands: what follows them is simulated as it was fitted.
  if (std::ranges::any_of(
          model.effects, [](const BoundEffect& e) { return e.info().has(Trait::kReadsCommand); }) &&
      std::ranges::all_of(model.series, hides_motor))
    return false;
  return !model.series.empty() || std::ranges::any_of(model.effects, [](const BoundEffect& e) {
    return reads_acceleration(e) || reads_time(e) || e.info().port == Port::kLinkForce;
  });
}

void ReplayedWindows::set_grid(const MotionStretch& stretch, const MotionWindow& window) {
  if (grid_.stretch == &stretch && grid_.first == window.first && grid_.rows == window.rows) return;
  const auto first = stretch.time.begin() + window.first;
  const double from = *first, to = *(first + window.rows - 1);
  std::vector<double> steps;
  for (long k = 1; k < window.rows; ++k) steps.push_back(*(first + k) - *(first + k - 1));
  const double dt = median(std::move(steps));
  const long before =
      1 + std::min(std::lround(kBefore / dt),
                   static_cast<long>(std::floor((from - stretch.time.front()) / dt)));
  const long inside = static_cast<long>(std::ceil((to - from) / dt - 1e-6)) + 1;
  Grid& g = grid_;
  g = {&stretch, window.first, window.rows, {}, {}, before, before + inside + kMargin, from};
  const long rows = g.end + 1, n = stretch.q.cols();
  const double start = from - static_cast<double>(before) * dt;
  g.motion.dt = dt;
  g.motion.start = start - begin_;
  g.motion.run = stretch.run;
  g.motion.q.resize(rows, n);
  g.motion.qd = g.motion.qdd = RowMatX<double>::Zero(rows, n);
  g.torque.resize(rows, n);
  for (long j = 0; j < n; ++j) {
    VecX<double> column(rows);
    fill(stretch, j, start, dt, column);
    g.motion.q.col(j) = column;
  }
  for (long k = 0; k < rows; ++k)
    g.torque.row(k) = torque_at(stretch, start + (static_cast<double>(k) + 0.5) * dt);
  // Hidden motors read the motion about the first row.
  const long near = std::upper_bound(first, first + window.rows, from + 0.1) - first;
  for (long k = before - 1; k <= before + 1; ++k) {
    const LocalMotion at = local_motion(stretch, start + static_cast<double>(k) * dt, window.first,
                                        std::max<long>(near, 2));
    g.motion.q.row(k) = at.q.transpose();
    g.motion.qd.row(k) = at.qd.transpose();
    g.motion.qdd.row(k) = at.qdd.transpose();
  }
}

RowMatX<double> ReplayedWindows::positions(const MotionStretch& stretch,
                                           const MotionWindow& window) {
  set_grid(stretch, window);
  const Grid& g = grid_;
  const long n = stretch.q.cols();
  RowMatX<double> on_grid =
      replay(model_, g.motion, g.torque, g.begin, g.end, &window.state, stretch.run);
  for (long j = 0; j < n; ++j)  // rows before a late clock's first: a parabola goes on
    for (long k = std::min<long>(kMargin, on_grid.rows() - 3); k-- > 0;)
      if (std::isnan(on_grid(k, j)))
        on_grid(k, j) = on_grid(k + 3, j) + 3.0 * (on_grid(k + 1, j) - on_grid(k + 2, j));
  RowMatX<double> out(window.rows, n);
  for (long k = 0; k < window.rows; ++k) {
    const double at = (stretch.time[window.first + k] - g.start) / g.motion.dt;
    for (long j = 0; j < n; ++j) out(k, j) = between(on_grid.col(j), at);
  }
  return out;
}

}  // namespace diffnea
