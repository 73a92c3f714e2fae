#include "diagnose/differenced_windows.hpp"

#include <algorithm>
#include <cmath>

#include "core/constants.hpp"

namespace diffnea {
namespace {

/// The part of a model that ForwardDynamics has derivatives of.
ExtendedTree of_one_instant(ExtendedTree model) {
  model.series.clear();
  std::erase_if(model.effects, [](const BoundEffect& e) {
    return !e.is_local() || e.info().port == Port::kLinkForce || reads_acceleration(e) ||
           reads_time(e);
  });
  return model;
}

}  // namespace

DifferencedWindows::DifferencedWindows(const ExtendedTree& model)
    : dynamics_(of_one_instant(model)) {}

const RowMatX<double>& DifferencedWindows::simulated(const MotionStretch& stretch,
                                                     const MotionWindow& window) {
  if (last_.stretch != &stretch || last_.first != window.first || last_.rows != window.rows)
    last_ = {&stretch, window.first, window.rows, {}, {}, {}, false};
  if (last_.state.size() == 0 || last_.state != window.state) {
    last_.simulated = positions(stretch, window);
    last_.state = window.state;
  }
  return last_.simulated;
}

double DifferencedWindows::cost(const MotionStretch& stretch, const MotionWindow& window,
                                const VecX<double>& sigma) {
  const RowMatX<double>& q = simulated(stretch, window);
  double sum = 0.0;
  for (long k = 0; k < window.rows; ++k)
    for (long j = 0; j < q.cols(); ++j) {
      const double measured = stretch.q(window.first + k, j);
      if (std::isnan(q(k, j))) return kInfinity;
      if (!std::isnan(measured)) sum += 0.5 * std::pow((q(k, j) - measured) / sigma[j], 2);
    }
  return sum;
}

void DifferencedWindows::differentiate(const MotionStretch& stretch, const MotionWindow& window,
                                       const VecX<double>& sigma) {
  constexpr double kStep = 1e-2;  // share of a move by σ: beyond rounding, within a corner
  const RowMatX<double>& q = simulated(stretch, window);
  const long n = q.cols();
  const double seconds = stretch.time[window.first + window.rows - 1] - stretch.time[window.first];
  last_.by_state.clear();
  for (long c = 0; c < 2 * n; ++c) {
    const double step = kStep * sigma[c % n] / (c < n ? 1.0 : std::max(seconds, 1e-3));
    MotionWindow moved = window;
    moved.state[c] += step;
    last_.by_state.push_back((positions(stretch, moved) - q) / step);
  }
}

RowMatX<double> DifferencedWindows::rows_of(const MotionStretch& stretch,
                                            const MotionWindow& window,
                                            const VecX<double>& sigma) const {
  const RowMatX<double>& q = last_.simulated;
  const long n = q.cols(), width = 2 * n;
  RowMatX<double> out(window.rows * n, width + 1);
  long filled = 0;
  for (long k = 0; k < window.rows; ++k)
    for (long j = 0; j < n; ++j) {
      const double measured = stretch.q(window.first + k, j);
      if (std::isnan(measured)) continue;
      for (long c = 0; c < width; ++c) out(filled, c) = last_.by_state[c](k, j) / sigma[j];
      out(filled++, width) = (q(k, j) - measured) / sigma[j];
    }
  return out.topRows(filled);
}

/// Backward Euler in the velocities, at the rows: steep friction forgets within one.
void DifferencedWindows::follow(const MotionStretch& stretch, const MotionWindow& window) {
  const RowMatX<double>& q = simulated(stretch, window);
  const long n = q.cols(), m = window.rows;
  last_.by_state.assign(static_cast<std::size_t>(2 * n), RowMatX<double>::Constant(m, n, kNaN));
  const MatX<double> one = MatX<double>::Identity(n, n);
  MatX<double> position = MatX<double>::Zero(n, 2 * n), velocity = position;
  position.leftCols(n) = one;
  velocity.rightCols(n) = one;
  const auto time = [&](long k) { return stretch.time[window.first + k]; };
  for (long k = 0; k < m; ++k) {
    for (long c = 0; c < 2 * n; ++c) last_.by_state[c].row(k) = position.col(c).transpose();
    if (k + 1 == m) break;
    const long before = std::max<long>(k - 1, 0), after = k + 1;
    const VecX<double> at = q.row(k).transpose(), u = stretch.u.row(window.first + k).transpose(),
                       speed =
                           k == 0 ? VecX<double>(window.state.tail(n))
                                  : VecX<double>((q.row(after) - q.row(before)).transpose() /
                                                 (time(after) - time(before)));
    if (!at.allFinite() || !speed.allFinite()) return;
    dynamics_.linearise(at.data(), speed.data(), u.data(), stretch.run);
    const double h = time(k + 1) - time(k);
    const MatX<double> W = one - h * dynamics_.dqdd_dqd();
    velocity += h * (dynamics_.dqdd_dq() * position);
    velocity = W.partialPivLu().solve(velocity);
    position += h * velocity;
  }
}

bool DifferencedWindows::sharpen() {
  const bool may = !last_.differences;
  last_.differences = true;
  return may;
}

bool DifferencedWindows::linearise(const MotionStretch& stretch, const MotionWindow& window,
                                   const VecX<double>& sigma, TriangularFactor& rows) {
  simulated(stretch, window);
  if (last_.differences)
    differentiate(stretch, window, sigma);
  else
    follow(stretch, window);
  const RowMatX<double> block = rows_of(stretch, window, sigma);
  if (!block.allFinite()) return false;
  rows.add(block);
  return true;
}

}  // namespace diffnea
