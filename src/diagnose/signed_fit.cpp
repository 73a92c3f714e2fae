#include "diagnose/signed_fit.hpp"

#include <algorithm>
#include <cmath>

#include "core/decompositions.hpp"

namespace diffnea {
VecX<double> ridge_solve(MatX<double> K, const VecX<double>& b, double ridge) {
  VecX<double> unit = K.diagonal().cwiseSqrt();
  for (double& u : unit) u = u > 0.0 ? 1.0 / u : 0.0;
  K = unit.asDiagonal() * K * unit.asDiagonal();
  K.diagonal().array() += ridge;
  return unit.cwiseProduct(K.ldlt().solve(unit.cwiseProduct(b)));
}

SignedFit signed_fit(const MatX<double>& K, const VecX<double>& b,
                     const std::vector<bool>& nonnegative, const VecX<double>& start) {
  const long n = b.size();
  SignedFit out;
  out.x = start.size() > 0 ? start : VecX<double>::Zero(n);
  std::vector<bool> active(nonnegative.begin(), nonnegative.end());  // held at zero
  for (long i = 0; i < n; ++i) active[i] = active[i] && !(out.x[i] > 0.0);
  for (int iteration = 0; iteration < 10 * n + 10; ++iteration) {
    std::vector<int> on;
    for (long i = 0; i < n; ++i)
      if (!active[i]) on.push_back(static_cast<int>(i));
    VecX<double> target = VecX<double>::Zero(n);
    if (!on.empty()) {
      const VecX<double> s = ridge_solve(K(on, on), b(on), 1e-10);
      for (std::size_t i = 0; i < on.size(); ++i) target[on[i]] = s[i];
    }
    // As far towards the target as signs allow.
    double step = 1.0;
    int block = -1;
    for (const int i : on)
      if (nonnegative[i] && target[i] < 0.0) {
        const double t = out.x[i] / (out.x[i] - target[i]);
        if (t < step) step = t, block = i;
      }
    out.x += step * (target - out.x);
    if (block >= 0) {
      active[block] = true;
      out.x[block] = 0.0;
      continue;
    }
    const VecX<double> gradient = b - K * out.x;
    long best = -1;
    double most = 1e-9;
    for (long i = 0; i < n; ++i) {
      if (!active[i] || !(K(i, i) > 0.0)) continue;
      const double g =
          gradient[i] / (std::sqrt(K(i, i)) * (1.0 + std::abs(b[i]) / std::sqrt(K(i, i))));
      if (g > most) most = g, best = i;
    }
    if (best < 0) break;
    active[best] = false;
  }
  out.gain = 2.0 * b.dot(out.x) - out.x.dot(K * out.x);
  return out;
}

}  // namespace diffnea
