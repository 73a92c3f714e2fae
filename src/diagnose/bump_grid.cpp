#include "diagnose/bump_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace diffnea {
namespace {

/// Bumps at most: a simulation evaluates all of them at every step.
constexpr long kMostBumps = 160;
/// Rows within a width of a bump's centre; with fewer, it is no inducing point.
constexpr long kLeastRows = 8;
/// Intervals of a grid over the range of its variable, coarse to fine.
const std::vector<int> kIntervals{3, 4, 6, 8, 11, 15, 20, 27, 36};

/// A grid of one variable: even, or with points as dense about 0 as `dense` says (friction turns
/// there): x = dense sinh(t), even in t.
struct Spacing {
  int intervals = 6;
  bool about_zero = false;
  auto operator<=>(const Spacing&) const = default;
};

struct Points {
  std::vector<double> centres, widths;
};

Points points(const Spacing& s, double low, double high) {
  const double n = s.intervals;
  // At the middle the points are ten times as dense as at the ends.
  const double dense = 0.1 * std::max(std::abs(low), std::abs(high));
  const auto t_of = [&](double x) { return s.about_zero ? std::asinh(x / dense) : x; };
  const double a = t_of(low), b = t_of(high), h = (b - a) / n;
  Points out;
  for (int i = 0; i <= s.intervals; ++i) {
    const double t = a + h * i;
    out.centres.push_back(s.about_zero ? dense * std::sinh(t) : t);
    out.widths.push_back(s.about_zero ? dense * std::cosh(t) * h : h);
  }
  return out;
}

/// Bumps where there is data: every point of the grid with enough used rows about it.
BumpTable grid(const std::vector<Spacing>& spacing, const MatX<double>& x,
               const std::vector<bool>& used) {
  std::vector<Points> axis;
  for (long k = 0; k < x.cols(); ++k) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (long i = 0; i < x.rows(); ++i)
      if (used[i]) {
        low = std::min(low, x(i, k));
        high = std::max(high, x(i, k));
      }
    axis.push_back(points(spacing[k], low, high));
  }
  const long n0 = std::ssize(axis[0].centres);
  const long n1 = axis.size() > 1 ? std::ssize(axis[1].centres) : 1;
  std::vector<long> rows(n0 * n1, 0);
  for (long i = 0; i < x.rows(); ++i) {
    if (!used[i]) continue;
    for (long a = 0; a < n0; ++a) {
      const auto near = [&](long k, long at) {
        const Points& p = axis[k];
        return std::abs(x(i, k) - p.centres[at]) < p.widths[at];
      };
      if (!near(0, a)) continue;
      for (long b = 0; b < n1; ++b) rows[a * n1 + b] += n1 == 1 || near(1, b);
    }
  }
  BumpTable out;
  for (long a = 0; a < n0; ++a)
    for (long b = 0; b < n1; ++b) {
      if (rows[a * n1 + b] < kLeastRows) continue;
      for (std::size_t k = 0; k < axis.size(); ++k) {
        const std::size_t at = static_cast<std::size_t>(k == 0 ? a : b);
        out.centres.push_back(axis[k].centres[at]);
        out.widths.push_back(axis[k].widths[at]);
      }
      out.weights.push_back(0.0);
    }
  return out;
}

}  // namespace

MatX<double> bumps(const BumpTable& table, const MatX<double>& x) {
  const long n = x.cols(), count = std::ssize(table.weights);
  MatX<double> out = MatX<double>::Ones(x.rows(), count);
  for (long b = 0; b < count; ++b)
    for (long k = 0; k < n; ++k) {
      const double c = table.centres[b * n + k], h = table.widths[b * n + k];
      for (long i = 0; i < x.rows(); ++i) out(i, b) *= Residual::bump((x(i, k) - c) / h);
    }
  return out;
}

BumpTable best_grid(const std::function<double(const MatX<double>&)>& cost_of,
                    const MatX<double>& x, const Axes& axes, const std::vector<bool>& used,
                    int& tried) {
  std::map<std::vector<Spacing>, double> known;
  const auto cost = [&](const std::vector<Spacing>& s) {
    const auto [at, is_new] = known.try_emplace(s, std::numeric_limits<double>::infinity());
    if (!is_new) return at->second;
    const BumpTable table = grid(s, x, used);
    if (table.weights.empty() || std::ssize(table.weights) > kMostBumps) return at->second;
    return at->second = cost_of(bumps(table, x));
  };
  std::vector<Spacing> best;
  double least = std::numeric_limits<double>::infinity();
  const std::size_t kinds = std::size_t{1} << axes.size();
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    std::vector<std::size_t> at(axes.size(), 2);
    bool possible = true;
    const auto spacing = [&] {
      std::vector<Spacing> out;
      for (std::size_t k = 0; k < axes.size(); ++k)
        out.push_back({kIntervals[at[k]], (kind >> k & 1) != 0});
      return out;
    };
    for (std::size_t k = 0; k < axes.size(); ++k)
      possible = possible && (axes[k].velocity || (kind >> k & 1) == 0);
    if (!possible) continue;
    double now = cost(spacing());
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t k = 0; k < axes.size(); ++k)
        for (const int by : {1, -1}) {
          const std::size_t from = at[k];
          if (by < 0 ? from == 0 : from + 1 == kIntervals.size()) continue;
          at[k] = by < 0 ? from - 1 : from + 1;
          if (const double then = cost(spacing()); then < now) {
            now = then;
            moved = true;
            break;
          }
          at[k] = from;
        }
    }
    if (now < least) {
      least = now;
      best = spacing();
    }
  }
  tried = static_cast<int>(known.size());
  return best.empty() ? BumpTable{} : grid(best, x, used);
}

}  // namespace diffnea
