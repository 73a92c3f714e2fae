#pragma once
/// Order statistics, and how far a series hangs together. Internal.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace diffnea {

/// Element n/2 of n in order (the upper one of two in the middle); NaN of nothing.
/// @param x  any order, no NaN
inline double median(std::vector<double> x) {
  if (x.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

/// The element below which a share `p` of the others lies; NaN of nothing.
/// @param x  any order, no NaN
inline double quantile(std::vector<double> x, double p) {
  if (x.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = x.begin() + static_cast<std::ptrdiff_t>(p * static_cast<double>(x.size() - 1));
  std::nth_element(x.begin(), at, x.end());
  return *at;
}

/// 1 + 2 Σ |ρ_l| of a series: how many of its rows say what one independent row does. Signs are
/// left out: where a residual swings, so does what a parameter does there. The sum ends where
/// correlations are noise for half as long as it is.
inline double correlation_time(const std::vector<double>& r) {
  const long n = static_cast<long>(r.size());
  double mean_square = 0.0;
  for (const double x : r) mean_square += x * x;
  if (!(mean_square > 0.0)) return 1.0;
  const double noise = 2.0 / std::sqrt(static_cast<double>(n));
  double sum = 0.0;
  long last = 0;  // lag of the last correlation beyond noise
  for (long l = 1; l < n / 2 && l < last + 10 + last / 2; ++l) {
    double c = 0.0;
    for (long k = 0; k + l < n; ++k)
      c += r[static_cast<std::size_t>(k)] * r[static_cast<std::size_t>(k + l)];
    const double rho = std::abs(c / mean_square);
    if (rho < noise) continue;
    sum += rho;
    last = l;
  }
  return 1.0 + 2.0 * sum;
}

}  // namespace diffnea
