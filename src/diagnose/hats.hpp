#pragma once
/// Piecewise-linear functions of one variable: what a torque may be a function of. Internal to
/// diagnose/.

#include <algorithm>
#include <cmath>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Knots at quantiles of the fitted data, so that each interval holds rows.
inline std::vector<double> knots(const VecX<double>& x, int count) {
  std::vector<double> sorted(x.data(), x.data() + x.size());
  std::ranges::sort(sorted);
  std::vector<double> out;
  for (int k = 0; k < count; ++k) {
    const double v = sorted[std::lround(static_cast<double>(k) / (count - 1) *
                                        static_cast<double>(sorted.size() - 1))];
    if (out.empty() || v > out.back() + 1e-12 * (1.0 + std::abs(v))) out.push_back(v);
  }
  return out;
}

/// Piecewise-linear hats on the knots, constant beyond them. (N, knots)
inline MatX<double> hats(const VecX<double>& x, const std::vector<double>& t) {
  MatX<double> out = MatX<double>::Zero(x.size(), std::ssize(t));
  for (long i = 0; i < x.size(); ++i) {
    const auto above = std::ranges::upper_bound(t, x[i]);
    const long k = above - t.begin();
    if (k == 0) {
      out(i, 0) = 1.0;
    } else if (k == std::ssize(t)) {
      out(i, k - 1) = 1.0;
    } else {
      const double w = (x[i] - t[k - 1]) / (t[k] - t[k - 1]);
      out(i, k) = w;
      out(i, k - 1) = 1.0 - w;
    }
  }
  return out;
}

}  // namespace diffnea
