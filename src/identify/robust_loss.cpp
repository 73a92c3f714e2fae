#include "identify/robust_loss.hpp"

#include <cmath>

namespace diffnea {
namespace {

/// Tuning constants of 95 % efficiency at the Gaussian.
constexpr double kHuber = 1.345, kCauchy = 2.385;

}  // namespace

Influence influence_of(Robust kind, double u) {
  const double a = std::abs(u), c = 1.0 / (1.0 + (u / kCauchy) * (u / kCauchy));
  if (kind == Robust::kHuber && a > kHuber) return {kHuber / a, 0.0};
  if (kind == Robust::kCauchy) return {c, (2.0 * c - 1.0) * c};
  return {};
}

double robust_cost(Robust kind, double u) {
  const double a = std::abs(u);
  if (kind == Robust::kHuber && a > kHuber) return kHuber * (a - 0.5 * kHuber);
  if (kind == Robust::kCauchy)
    return 0.5 * kCauchy * kCauchy * std::log1p((u / kCauchy) * (u / kCauchy));
  return 0.5 * u * u;
}

}  // namespace diffnea
