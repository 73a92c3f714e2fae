#pragma once
/// Robust statistics of a channel. Internal to recording/.

#include <string>
#include <vector>

#include <diffnea/core/scalar.hpp>

#include "core/statistics.hpp"

namespace diffnea::detail {

/// Step of a channel that takes discrete values; 0 if it is finer than its own increments show.
double find_quantum(const VecX<double>& x);

/// printf into a string.
[[gnu::format(printf, 1, 2)]] std::string format(const char* text, ...);

/// Least squares y ≈ X b with a standard error that holds under correlation in time: the sandwich
/// over blocks of consecutive rows (each block's score is taken as one independent draw).
struct BlockFit {
  VecX<double> coefficients;
  VecX<double> std;
  VecX<double> residual;
  double explained = 0.0;  ///< 1 − RSS/TSS, TSS about the mean
};
/// @param block  (N) block of every row, 0 … B−1, not decreasing
BlockFit fit_in_blocks(const MatX<double>& x, const VecX<double>& y, const std::vector<int>& block);

}  // namespace diffnea::detail
