#include "diagnose/differenced_windows.hpp"

#include <algorithm>
#include <cmath>

#include "core/constants.hpp"

namespace diffnea {

const RowMatX<double>& DifferencedWindows::simulated(const MotionStretch& stretch,
                                                     const MotionWindow& window) {
  if (last_.stretch != &stretch || last_.first != window.first || last_.rows != window.rows)
    last_ = {&stretch, window.first, window.rows, {}, {}, {}};
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
  for (long c = 0; c < 2 * n; ++c) {
    const double step = kStep * sigma[c % n] / (c < n ? 1.0 : std::max(seconds, 1e-3));
    MotionWindow moved = window;
    moved.state[c] += step;
    last_.by_state.push_back((positions(stretch, moved) - q) / step);
  }
}

bool DifferencedWindows::linearise(const MotionStretch& stretch, const MotionWindow& window,
                                   const VecX<double>& sigma, TriangularFactor& rows) {
  const RowMatX<double>& q = simulated(stretch, window);
  if (last_.by_state.empty()) differentiate(stretch, window, sigma);
  const long n = q.cols(), width = 2 * n;
  RowMatX<double> block(window.rows * n, width + 1);
  long filled = 0;
  for (long k = 0; k < window.rows; ++k)
    for (long j = 0; j < n; ++j) {
      const double measured = stretch.q(window.first + k, j);
      if (std::isnan(measured)) continue;
      for (long c = 0; c < width; ++c)
        block(filled, c) = last_.by_state[static_cast<std::size_t>(c)](k, j) / sigma[j];
      block(filled++, width) = (q(k, j) - measured) / sigma[j];
    }
  const auto used = block.topRows(filled);
  if (!used.allFinite()) return false;
  rows.add(used);
  return true;
}

}  // namespace diffnea
