#pragma once
/// Kaiser's window. Internal to recording/.

#include <cmath>

namespace diffnea::detail {

/// Modified Bessel function I₀ by its power series (std::cyl_bessel_i is missing from libc++).
inline double bessel_i0(double x) {
  double term = 1.0, sum = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= (x / (2.0 * k)) * (x / (2.0 * k));
    sum += term;
  }
  return sum;
}

/// @param r  distance from the middle, 1 at the window's ends  @return 1 in the middle
inline double kaiser(double beta, double r) {
  return bessel_i0(beta * std::sqrt(std::fmax(0.0, 1.0 - r * r))) / bessel_i0(beta);
}

}  // namespace diffnea::detail
