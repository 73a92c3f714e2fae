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
constexpr double kGolden = 0.6180339887498949;
/// Time between rows over the median one that no difference is taken across.
constexpr double kGap = 5.0;

/// Differences, values and changes of one channel, over all recordings.
struct Channel {
  double step = 0.0;  // quantisation
  std::array<std::vector<double>, kHighestOrder + 1> left;  // |difference| over its weights' norm
  std::vector<double> values, changes;                      // between rows, not 0
  std::vector<double> periods;
};

/// |Divided differences| over the noise that they would have of noise 1. Those of a quantised
/// channel are multiples of its step, and so would be their median: each is spread evenly over a
/// step (a golden sequence), which noise_of() takes out again.
void add_differences(const std::vector<double>& t, const std::vector<double>& y, double period,
                     Channel& out) {
  const long n = static_cast<long>(t.size());
  double factorial = 1.0;
  for (int d = kLowestOrder; d <= kHighestOrder; ++d) {
    factorial *= d;
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
      std::vector<double>& left = out.left[static_cast<std::size_t>(d)];
      const double at = kGolden * static_cast<double>(left.size());
      // Rows of one value, off any grid, are of a joint that rests and say nothing of its noise.
      if (sum == 0.0 && out.step == 0.0) continue;
      sum += out.step / factorial * (at - std::floor(at) - 0.5);
      left.push_back(std::abs(sum) / std::sqrt(squares));
    }
  }
}

double noise_of(const Channel& channel) {
  double least = std::numeric_limits<double>::infinity();
  double squares = 2.0;  // of the weights, C(2d, d)
  for (int d = kLowestOrder; d <= kHighestOrder; ++d) {
    squares *= 2.0 * (2.0 * d - 1.0) / d;
    const auto& left = channel.left[static_cast<std::size_t>(d)];
    if (left.empty()) continue;
    const double all = kOverMedian * median(left),
                 spread = channel.step * channel.step / (12.0 * squares);
    least = std::min(least, std::sqrt(std::max(all * all - spread, 0.0)));
  }
  return std::isfinite(least) ? least : 0.0;
}

}  // namespace

SensorNoise sensor_noise(const std::vector<Recording>& recordings,
                         const std::vector<bool>& passive) {
  const int n = recordings.empty() ? 0 : recordings.front().num_joints();
  SensorNoise out;
  out.position = out.step = out.torque = out.density = out.period = VecX<double>::Zero(n);
  out.refresh = refresh_rows(recordings);
  std::vector<bool> stays;
  for (int j = 0; j < n; ++j) {
    Channel position, torque;
    for (const Recording& r : recordings) {
      long last = -1;
      for (long k = 0; k < r.rows(); ++k) {
        const double q = r.q(k, j);
        if (std::isnan(q)) continue;
        position.values.push_back(q);
        if (last >= 0 && q != r.q(last, j)) position.changes.push_back(q - r.q(last, j));
        last = k;
      }
    }
    if (position.values.empty())
      throw DataError(recordings.front().source + ": joint '" +
                      recordings.front().joint_names[static_cast<std::size_t>(j)] +
                      "' has no position in any row");
    out.step[j] = quantisation_step(position.values, position.changes);
    position.step = out.step[j];
    const int refresh = out.refresh[static_cast<std::size_t>(j)];
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
    stays.push_back(position.changes.empty());
  }
  // One value alone tells no noise, and no model is to be exact about it.
  const double largest = n > 0 ? out.position.maxCoeff() : 0.0;
  for (int j = 0; j < n; ++j)
    if (stays[static_cast<std::size_t>(j)]) out.position[j] = largest;
  return out;
}

}  // namespace diffnea
