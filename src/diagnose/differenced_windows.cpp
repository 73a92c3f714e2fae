#include "diagnose/differenced_windows.hpp"

#include <algorithm>
#include <cmath>

#include "core/constants.hpp"

namespace diffnea {

const RowMatX<double>& DifferencedWindows::simulated(const MotionStretch& stretch,
                                                     const MotionWindow& window) {
  if (last_.stretch != &stretch || last_.first != window.first || last_.rows != window.rows)
    last_ = {&stretch, window.first, window.rows, {}, {}, {}, 0};
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
  const double seconds = stretch.time[static_cast<std::size_t>(window.first + window.rows - 1)] -
                         stretch.time[static_cast<std::size_t>(window.first)];
  last_.by_state.clear();
  ++last_.differences;
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
      for (long c = 0; c < width; ++c)
        out(filled, c) = last_.by_state[static_cast<std::size_t>(c)](k, j) / sigma[j];
      out(filled++, width) = (q(k, j) - measured) / sigma[j];
    }
  return out.topRows(filled);
}

bool DifferencedWindows::linearise(const MotionStretch& stretch, const MotionWindow& window,
                                   const VecX<double>& sigma, TriangularFactor& rows) {
  constexpr double kStale = 0.1;  // share of the cost that old differences promise to remove
  constexpr int kMost = 6;        // differences of a window
  simulated(stretch, window);
  const bool old = !last_.by_state.empty();
  if (!old) differentiate(stretch, window, sigma);
  RowMatX<double> block = rows_of(stretch, window, sigma);
  const int width = static_cast<int>(block.cols()) - 1;
  if (old && last_.differences < kMost && block.allFinite()) {
    TriangularFactor factor(width);
    factor.add(block);
    if (factor.d().squaredNorm() > kStale * block.col(width).squaredNorm()) {
      differentiate(stretch, window, sigma);
      block = rows_of(stretch, window, sigma);
    }
  }
  if (!block.allFinite()) return false;
  rows.add(block);
  return true;
}

}  // namespace diffnea
