#pragma once
/// Order statistics. Internal.

#include <algorithm>
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

}  // namespace diffnea
