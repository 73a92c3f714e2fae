#pragma once

#include <algorithm>
#include <cmath>

#include <diffnea/core/compiled.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

DIFFNEA_INLINE VecX<double> derivative(const VecX<double>& f, double dt) {
  const long n = f.size();
  VecX<double> out = VecX<double>::Zero(n);
  if (n < 2) return out;
  if (n < 5) {
    for (long k = 0; k < n; ++k) {
      const long low = std::max(k - 1, 0L), high = std::min(k + 1, n - 1);
      out[k] = (f[high] - f[low]) / (static_cast<double>(high - low) * dt);
    }
    return out;
  }
  const double w = 1.0 / (12.0 * dt);
  // Abramowitz & Stegun 1964, Table 25.2: five points, first derivative.
  const auto first = [&](long a, long s) {
    return w * static_cast<double>(s) *
           (-25 * f[a] + 48 * f[a + s] - 36 * f[a + 2 * s] + 16 * f[a + 3 * s] - 3 * f[a + 4 * s]);
  };
  const auto second = [&](long a, long s) {
    return w * static_cast<double>(s) *
           (-3 * f[a] - 10 * f[a + s] + 18 * f[a + 2 * s] - 6 * f[a + 3 * s] + f[a + 4 * s]);
  };
  out[0] = first(0, 1);
  out[1] = second(0, 1);
  for (long k = 2; k < n - 2; ++k) out[k] = w * (f[k - 2] - 8 * f[k - 1] + 8 * f[k + 1] - f[k + 2]);
  out[n - 2] = second(n - 1, -1);
  out[n - 1] = first(n - 1, -1);
  return out;
}

DIFFNEA_INLINE VecX<double> shifted(const VecX<double>& f, double dt, double d) {
  const long n = f.size();
  if (n < 2) return f;
  const VecX<double> slope = derivative(f, dt) * dt;
  VecX<double> out(n);
  for (long k = 0; k < n; ++k) {
    const double at = std::clamp(static_cast<double>(k) + d / dt, 0.0, static_cast<double>(n - 1));
    const long i = std::min(static_cast<long>(at), n - 2);
    const double s = at - static_cast<double>(i), r = 1.0 - s;
    out[k] = r * r * ((1 + 2 * s) * f[i] + s * slope[i]) +
             s * s * ((1 + 2 * r) * f[i + 1] - r * slope[i + 1]);  // cubic Hermite
  }
  return out;
}

DIFFNEA_INLINE VecX<double> low_passed(const VecX<double>& f, double dt, double T) {
  if (!(T > 0.0) || f.size() < 2) return f;
  VecX<double> y(f.size());
  const double decay = std::exp(-dt / T);
  y[0] = f[0] - T * (f[1] - f[0]) / dt;
  for (long k = 0; k + 1 < f.size(); ++k) {
    const double lag = T * (f[k + 1] - f[k]) / dt;  // behind a ramp
    y[k + 1] = f[k + 1] - lag + decay * (y[k] - f[k] + lag);
  }
  return y;
}

}  // namespace diffnea
