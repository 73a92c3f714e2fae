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

/// By how many standard deviations of a normal distribution a coefficient of that fit is not 0, as
/// the fits tell that leave out one block each: few blocks make a Student's t of few degrees of
/// freedom, and a column that does not change within a block has a value for each block, whatever
/// the number of rows (jackknife: Efron, Stein 1981; t to normal: Wallace 1959).
/// @return 0 with fewer than three blocks
double jackknife_z(const MatX<double>& x, const VecX<double>& y, const std::vector<int>& block,
                   long column);

}  // namespace diffnea::detail
