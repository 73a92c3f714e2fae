#pragma once
/// Chances of noise. Internal to diagnose/.

#include <algorithm>
#include <cmath>
#include <numbers>

namespace diffnea {

/// Chance that χ² of `freedom` ≥ 1 degrees of freedom exceeds x (Abramowitz, Stegun 1964, 26.4.4
/// and 26.4.5).
inline double chi_square_tail(double x, int freedom) {
  const double half = std::max(x, 0.0) / 2.0, at = std::exp(-half);
  const bool odd = freedom % 2 == 1;
  double out = odd ? std::erfc(std::sqrt(half)) : at;
  double term = odd ? 2.0 * std::sqrt(half / std::numbers::pi) * at : half * at;
  for (int k = odd ? 1 : 2; k < freedom; k += 2) {  // of k, what k + 2 adds
    out += term;
    term *= half / (0.5 * k + 1.0);
  }
  return out;
}

}  // namespace diffnea
