#include "identify/ball_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/scalar.hpp>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"

namespace diffnea {
namespace {

constexpr long kSide = 5;               ///< rows of a parabola on one side
constexpr double kUnusual = 8.0;        ///< times the median deviation
constexpr double kLeastOutlier = 5e-3;  ///< [m]
constexpr double kLeastJump = 0.8;      ///< of the velocity at a bounce [m/s]

// Cubics that noise is told by: over this long a swing is one, to a hundredth of a millimetre.
constexpr double kBlockSeconds = 0.16;
constexpr long kLeastBlock = 6, kMostBlock = 17;
constexpr std::size_t kEnoughBlocks = 8;
constexpr double kHitBlock = 5.0;  ///< times the usual variance: a hit, or an outlier

/// Rows of one uninterrupted stretch: [first, end) of row k.
struct Stretch {
  long first, end;
};
std::vector<Stretch> stretches(const std::vector<double>& time, double longest_gap) {
  std::vector<Stretch> out(time.size());
  const auto n = static_cast<long>(time.size());
  for (long first = 0; first < n;) {
    long end = first + 1;
    while (end < n && time[end] - time[end - 1] <= longest_gap) ++end;
    for (long k = first; k < end; ++k) out[k] = {first, end};
    first = end;
  }
  return out;
}

}  // namespace

Parabola parabola(const std::vector<double>& time, const std::vector<Vec3<double>>& seen,
                  long first, long end, double t0, long skip) {
  const long n = end - first - (skip >= first && skip < end ? 1 : 0);
  MatX<double> A(n, 3), y(n, 3);
  long row = 0;
  for (long k = first; k < end; ++k) {
    if (k == skip) continue;
    const double t = time[k] - t0;
    A.row(row) << 1.0, t, 0.5 * t * t;
    y.row(row++) << seen[k].x, seen[k].y, seen[k].z;
  }
  const MatX<double> c = A.colPivHouseholderQr().solve(y);
  const auto point = [&](int i) { return Vec3<double>{c(i, 0), c(i, 1), c(i, 2)}; };
  return {point(0), point(1), point(2)};
}

std::vector<double> find_outliers(const std::vector<double>& time,
                                  const std::vector<Vec3<double>>& seen, double longest_gap) {
  const auto n = static_cast<long>(time.size());
  const std::vector<Stretch> stretch = stretches(time, longest_gap);
  // Deviations from the rows before, after, and around; NaN where there are too few.
  std::vector<std::array<double, 3>> off(time.size());
  std::array<std::vector<double>, 3> usual;
  for (long k = 0; k < n; ++k) {
    const long low = std::max(stretch[k].first, k - kSide),
               high = std::min(stretch[k].end, k + kSide + 1);
    const std::array<std::array<long, 2>, 3> sides{
        {{low, k}, {k + 1, high}, {std::max(low, k - 3), std::min(high, k + 4)}}};
    for (int s = 0; s < 3; ++s) {
      const auto [first, end] = sides[s];
      const bool enough = s < 2 ? end - first >= kSide : k - first >= 2 && end - k >= 3;
      off[k][s] = enough ? norm(parabola(time, seen, first, end, time[k], k).x - seen[k])
                         : std::numeric_limits<double>::quiet_NaN();
      if (enough) usual[s].push_back(off[k][s]);
    }
  }
  std::array<double, 3> limit{};
  for (int s = 0; s < 3; ++s) limit[s] = std::max(kLeastOutlier, kUnusual * median(usual[s]));
  std::vector<double> out(time.size(), 0.0);
  for (long k = 0; k < n; ++k) {
    bool off_all = false;
    double least = std::numeric_limits<double>::infinity();
    for (int s = 0; s < 3; ++s) {
      if (std::isnan(off[k][s])) continue;
      off_all = least == std::numeric_limits<double>::infinity() || off_all;
      if (off[k][s] <= limit[s]) {
        off_all = false;
        break;
      }
      least = std::min(least, off[k][s]);
    }
    if (off_all && std::isfinite(least)) out[k] = least;
  }
  // One row that is far off spoils the parabolas of its neighbours: the worst of a few stays alone.
  for (long k = 0; k < n; ++k)
    for (long i = std::max(0L, k - kSide); i < std::min(n, k + kSide + 1); ++i)
      if (out[k] > 0.0 && out[i] > 2.0 * out[k]) out[k] = 0.0;
  return out;
}

std::vector<bool> find_kinks(const std::vector<double>& time, const std::vector<Vec3<double>>& seen,
                             double longest_gap) {
  const auto n = static_cast<long>(time.size());
  const std::vector<Stretch> stretch = stretches(time, longest_gap);
  std::vector<bool> out(time.size(), false);
  for (long k = 0; k < n; ++k) {
    const long low = std::max(stretch[k].first, k - kSide),
               high = std::min(stretch[k].end, k + kSide + 1);
    if (k - low < 3 || high - k < 4) continue;
    bool lowest = true;
    for (long i = low; i < high; ++i) lowest = lowest && seen[i].z >= seen[k].z;
    if (!lowest) continue;
    // Slopes of lines through three rows on either side; gravity bends them by less than the jump.
    const double before = (seen[k - 1].z - seen[k - 3].z) / (time[k - 1] - time[k - 3]),
                 after = (seen[k + 3].z - seen[k + 1].z) / (time[k + 3] - time[k + 1]);
    if (after - before > kLeastJump && before < 0.0 && after > 0.0) out[k] = true;
  }
  return out;
}

double camera_noise(const std::vector<double>& time, const std::vector<Vec3<double>>& seen,
                    double longest_gap) {
  const auto n = static_cast<long>(time.size());
  const std::vector<Stretch> stretch = stretches(time, longest_gap);
  std::vector<double> variances;
  for (long first = 0; first < n;) {
    long end = first + 1;
    while (end < stretch[first].end && time[end] - time[first] <= kBlockSeconds &&
           end - first < kMostBlock)
      ++end;
    const long rows = end - first;
    if (rows >= kLeastBlock && time[end - 1] - time[first] <= 2.0 * kBlockSeconds) {
      MatX<double> A(rows, 4), y(rows, 3);
      for (long k = 0; k < rows; ++k) {
        const double t = (time[first + k] - time[first]) / kBlockSeconds;
        A.row(k) << 1.0, t, t * t, t * t * t;
        y.row(k) << seen[first + k].x, seen[first + k].y, seen[first + k].z;
      }
      const MatX<double> e = y - A * A.colPivHouseholderQr().solve(y);
      variances.push_back(e.squaredNorm() / (3.0 * static_cast<double>(rows - 4)));
    }
    first = end;
  }
  if (variances.size() < kEnoughBlocks) return std::numeric_limits<double>::quiet_NaN();
  const double usual = median(variances);
  double sum = 0.0, count = 0.0;
  for (const double v : variances)
    if (v < kHitBlock * usual) sum += v, count += 1.0;
  return std::sqrt(sum / count);
}

}  // namespace diffnea
