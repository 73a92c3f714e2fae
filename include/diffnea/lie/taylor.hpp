#pragma once
/// Functions of an angle θ that are even in it, as functions of s = θ²: smooth at 0, where a square
/// root is not. Derivatives of any order pass through, of Jets and nested duals too. For scalars
/// whose value is one number (not packs).

#include <diffnea/core/scalar.hpp>

namespace diffnea {

namespace detail {

/// Largest s that takes a series: beyond it no closed form below loses more than 3 bits.
inline constexpr double kSeriesLimit = 1.0;

/// first! Σ (−s)^k / (2k + first)!, to rounding for s ≤ kSeriesLimit.
template <class T>
T alternating_series(const T& s, int first) {
  T sum(1.0);
  for (int k = 9; k > 0; --k) {
    const double divisor = (2 * k + first - 1) * (2 * k + first);
    sum = T(1.0) - s * sum * T(1.0 / divisor);
  }
  return sum;
}

}  // namespace detail

/// sin θ / θ.
template <class T>
T sine_over_angle(const T& s) {
  using std::sin;
  using std::sqrt;
  if (value(s) < detail::kSeriesLimit) return detail::alternating_series(s, 1);
  const T angle = sqrt(s);
  return sin(angle) / angle;
}

/// (1 − cos θ) / θ² = ½ (sin(θ/2) / (θ/2))².
template <class T>
T versine_over_square(const T& s) {
  const T half = sine_over_angle(T(s * T(0.25)));
  return half * half * T(0.5);
}

/// (θ − sin θ) / θ³.
template <class T>
T angle_minus_sine_over_cube(const T& s) {
  if (value(s) < detail::kSeriesLimit) return detail::alternating_series(s, 3) * T(1.0 / 6.0);
  return (T(1.0) - sine_over_angle(s)) / s;
}

/// (1 − ½ θ cot(θ/2)) / θ²; |θ| < 2π.
template <class T>
T cotangent_defect(const T& s) {
  // Σ |B_2k| s^(k−1) / (2k)!, Bernoulli's numbers (Abramowitz and Stegun 1964, 4.3.70); a term is
  // about 1/39 of the one before it at s = 1.
  constexpr double kLimit = 0.1;
  if (value(s) < kLimit) {
    T sum(691.0 / 1307674368000.0);
    for (const double c :
         {1.0 / 47900160.0, 1.0 / 1209600.0, 1.0 / 30240.0, 1.0 / 720.0, 1.0 / 12.0})
      sum = T(c) + s * sum;
    return sum;
  }
  return (T(1.0) - T(0.5) * sine_over_angle(s) / versine_over_square(s)) / s;
}

/// θ / sin(θ/2), 0 ≤ θ ≤ π, of s = sin²(θ/2) and c = cos(θ/2): the factor from the vector part of a
/// unit quaternion to the rotation vector.
template <class T>
T angle_over_half_sine(const T& s, const T& c) {
  using std::atan2;
  using std::sqrt;
  constexpr double kLimit = 0.01;
  if (value(s) < kLimit) {
    T sum(1.0);  // arcsin n / n = Σ ((2k)! / (2^k k!)²) s^k / (2k + 1), nested
    for (int k = 8; k > 0; --k) {
      const double odd = 2 * k - 1;
      sum = T(1.0) + s * sum * T(odd * odd / (2.0 * k * (2 * k + 1)));
    }
    return T(2.0) * sum;
  }
  const T n = sqrt(s);
  return T(2.0) * atan2(n, c) / n;
}

}  // namespace diffnea
