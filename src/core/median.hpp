#pragma once
/// Internal to the library.

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

}  // namespace diffnea
