#include <algorithm>
#include <array>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/motion/sensor_noise.hpp>

#include "core/statistics.hpp"

namespace diffnea {
namespace {

constexpr int kLowestOrder = 2, kHighestOrder = 6;
/// Standard deviation over the median of |x| of a Gaussian.
constexpr double kOverMedian = 1.4826;
/// Time between rows over the median one that no difference is taken across.
constexpr double kGap = 5.0;

/// Differences, values and changes of one channel, over all recordings.
struct Channel {
  std::array<std::vector<double>, kHighestOrder + 1> left;  // |difference| in units of σ = 1
  std::vector<double> values, changes;                      // sorted later; between rows, not 0
  std::vector<double> periods;
};

/// |Divided differences| over the noise that they would have of noise 1.
void add_differences(const std::vector<double>& t, const std::vector<double>& y, double period,
                     Channel& out) {
  const long n = static_cast<long>(t.size());
  for (int d = kLowestOrder; d <= kHighestOrder; ++d)
    for (long k = 0; k + d < n; ++k) {
      bool gap = false;
      for (int i = 0; i < d; ++i) gap = gap || t[k + i + 1] - t[k + i] > kGap * period;
      if (gap) continue;
      double sum = 0.0, squares = 0.0;
      for (int i = 0; i <= d; ++i) {
        double w = 1.0;
        for (int m = 0; m <= d; ++m)
          if (m != i) w *= period / (t[k + i] - t[k + m]);
        sum += w * (y[k + i] - y[k]);  // weights add up to 0; less rounding
        squares += w * w;
      }
      out.left[static_cast<std::size_t>(d)].push_back(std::abs(sum) / std::sqrt(squares));
    }
}

double noise_of(const Channel& channel) {
  double least = std::numeric_limits<double>::infinity();
  for (int d = kLowestOrder; d <= kHighestOrder; ++d)
    if (const auto& left = channel.left[static_cast<std::size_t>(d)]; !left.empty())
      least = std::min(least, kOverMedian * median(left));
  return std::isfinite(least) ? least : 0.0;
}

/// Step of the grid that all values lie on; 0 if there is none.
double quantisation(Channel& channel) {
  constexpr double kOnGrid = 0.05;  // distance from the grid over the step that counts as on it
  constexpr double kShare = 0.95;  // least share of changes on the grid; a tenth would be by chance
  std::vector<double>& v = channel.values;
  std::ranges::sort(v);
  std::vector<double> gaps;
  const double rounding =
      v.empty() ? 0.0 : 1e-12 * std::max(std::abs(v.front()), std::abs(v.back()));
  for (std::size_t k = 1; k < v.size(); ++k)
    if (v[k] - v[k - 1] > rounding) gaps.push_back(v[k] - v[k - 1]);
  if (gaps.empty()) return 0.0;
  const double step = quantile(gaps, 0.05);
  long on = 0;
  for (const double c : channel.changes)
    on += std::abs(c / step - std::round(c / step)) < kOnGrid ? 1 : 0;
  return on > kShare * static_cast<double>(channel.changes.size()) ? step : 0.0;
}

/// Rows from one new value to the next, where values jump by far more than the grid's step.
int refresh_of(const std::vector<std::pair<long, double>>& moves, double step) {
  constexpr double kFar = 3.0;  // jump over the step that quantisation does not explain
  std::vector<double> rows;
  for (const auto& [held, jump] : moves)
    if (jump > kFar * step) rows.push_back(static_cast<double>(held));
  return rows.size() < 8 ? 1 : static_cast<int>(median(rows));
}

}  // namespace

std::vector<bool> refreshed(const Eigen::Ref<const VecX<double>>& channel, int refresh) {
  std::vector<bool> out(static_cast<std::size_t>(channel.size()));
  long last = -1;
  for (long k = 0; k < channel.size(); ++k) {
    if (std::isnan(channel[k])) continue;
    if (refresh > 1 && last >= 0 && channel[k] == channel[last] && k - last < refresh) continue;
    out[static_cast<std::size_t>(k)] = true;
    last = k;
  }
  return out;
}

SensorNoise sensor_noise(const std::vector<Recording>& recordings,
                         const std::vector<bool>& passive) {
  const int n = recordings.empty() ? 0 : recordings.front().num_joints();
  SensorNoise out;
  out.position = out.step = out.torque = out.density = out.period = VecX<double>::Zero(n);
  out.refresh.assign(static_cast<std::size_t>(n), 1);
  for (int j = 0; j < n; ++j) {
    Channel position, torque;
    std::vector<std::pair<long, double>> moves;  // rows since the last change, size of this one
    for (const Recording& r : recordings) {
      long changed = -1, last = -1;
      for (long k = 0; k < r.rows(); ++k) {
        const double q = r.q(k, j);
        if (std::isnan(q)) continue;
        position.values.push_back(q);
        if (last >= 0 && q != r.q(last, j)) {
          position.changes.push_back(q - r.q(last, j));
          if (changed >= 0) moves.emplace_back(k - changed, std::abs(position.changes.back()));
          changed = k;
        }
        last = k;
      }
    }
    if (position.values.empty())
      throw DataError(recordings.front().source + ": joint '" +
                      recordings.front().joint_names[static_cast<std::size_t>(j)] +
                      "' has no position in any row");
    out.step[j] = quantisation(position);
    const int refresh = refresh_of(moves, out.step[j]);
    out.refresh[static_cast<std::size_t>(j)] = refresh;
    double row = 0.0;  // median time between two rows of the log
    {
      std::vector<double> rows;
      for (const Recording& r : recordings)
        for (long k = 1; k < r.rows(); ++k) rows.push_back(r.time[k] - r.time[k - 1]);
      row = rows.empty() ? 0.0 : median(std::move(rows));
    }
    out.period[j] = row * refresh;
    for (const Recording& r : recordings) {
      std::vector<double> t, y, tt, u;
      const std::vector<bool> counts = refreshed(r.q.col(j), refresh);
      for (long k = 0; k < r.rows(); ++k) {
        if (counts[static_cast<std::size_t>(k)]) {
          t.push_back(r.time[k]);
          y.push_back(r.q(k, j));
        }
        if (!std::isnan(r.tau(k, j))) {
          tt.push_back(r.time[k]);
          u.push_back(r.tau(k, j));
        }
      }
      add_differences(t, y, out.period[j], position);
      if (!passive[static_cast<std::size_t>(j)]) add_differences(tt, u, row, torque);
    }
    out.position[j] = std::max({noise_of(position), out.step[j] / std::sqrt(12.0), kPositionFloor});
    out.torque[j] = noise_of(torque);
    out.density[j] = out.torque[j] * out.torque[j] * row;
  }
  return out;
}

}  // namespace diffnea
