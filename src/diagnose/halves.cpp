#include "diagnose/halves.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace diffnea {
namespace {

/// Samples of a half over the path's cut-off: at two thirds of it, where the motion is as small as
/// the noise, polynomials of degree 5 between them are then good to a tenth.
constexpr double kRateOfHalf = 2.5;
/// Known positions on either side, of which one between them is made.
constexpr int kEachSide = 3;
/// Change of slope, over the positions' size, that is rounding of lines between new ones.
constexpr double kRounding = 1e-12;

int refresh_of(const PreprocessPlan& plan, long j) {
  return static_cast<std::size_t>(j) < plan.refresh.size() ? plan.refresh[static_cast<std::size_t>(j)]
                                                           : 1;
}

/// Rows at which a sensor has shown something new.
std::vector<long> new_rows(const VecX<double>& y, int refresh) {
  std::vector<long> out;
  const double rounding = kRounding * y.cwiseAbs().maxCoeff();
  for (long k = 0; k < y.size(); ++k)
    if (refresh < 2 || k == 0 || k + 1 == y.size() ||
        std::abs(y[k + 1] - 2.0 * y[k] + y[k - 1]) > rounding)
      out.push_back(k);
  return out;
}

/// Lagrange's polynomial through the known rows next to `row`.
double between(const VecX<double>& y, const std::vector<long>& known, long row) {
  const auto after = std::ranges::upper_bound(known, row);
  const auto first = known.begin() + std::max(0L, (after - known.begin()) - kEachSide),
             last = known.begin() +
                    std::min<long>(static_cast<long>(known.size()), (after - known.begin()) + kEachSide);
  double out = 0.0;
  for (auto i = first; i != last; ++i) {
    double weight = 1.0;
    for (auto j = first; j != last; ++j)
      if (j != i) weight *= static_cast<double>(row - *j) / static_cast<double>(*i - *j);
    out += weight * y[*i];
  }
  return out;
}

}  // namespace

bool halves_suffice(const PreprocessPlan& plan) {
  int slowest = 1;
  for (const int r : plan.refresh) slowest = std::max(slowest, r);
  return plan.filter_hz * kRateOfHalf * 2.0 * slowest * plan.dt <= 1.0;
}

RowMatX<double> half_of(const RowMatX<double>& logged, const PreprocessPlan& plan, bool even) {
  RowMatX<double> out = logged;
  for (long j = 0; j < logged.cols(); ++j) {
    const VecX<double> y = logged.col(j);
    const std::vector<long> rows = new_rows(y, refresh_of(plan, j));
    std::vector<long> known;
    for (std::size_t i = even ? 0 : 1; i < rows.size(); i += 2) known.push_back(rows[i]);
    if (known.empty()) continue;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if ((i % 2 == 0) != even) out(rows[i], j) = between(y, known, rows[i]);
      for (long k = i > 0 ? rows[i - 1] + 1 : 0; k < rows[i]; ++k) {
        const double share = static_cast<double>(k - rows[i - 1]) /
                             static_cast<double>(rows[i] - rows[i - 1]);
        out(k, j) = (1.0 - share) * out(rows[i - 1], j) + share * out(rows[i], j);
      }
    }
  }
  return out;
}

}  // namespace diffnea
