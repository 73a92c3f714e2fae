#include <algorithm>
#include <cmath>
#include <utility>

#include <diffnea/recording/refresh.hpp>

#include "core/statistics.hpp"

namespace diffnea {
namespace {

/// Rows from one new value to the next, where values jump by far more than the grid's step.
int refresh_of(const std::vector<std::pair<long, double>>& moves, double step) {
  constexpr double kFar = 3.0;  // jump over the step that quantisation does not explain
  std::vector<double> rows;
  for (const auto& [held, jump] : moves)
    if (jump > kFar * step) rows.push_back(static_cast<double>(held));
  return rows.size() < 8 ? 1 : static_cast<int>(median(rows));
}

struct ChannelChanges {
  std::vector<double> values, changes;
  std::vector<std::pair<long, double>> moves;  ///< rows since the last change, size of this one
};

/// Changes of every joint, over all recordings.
std::vector<ChannelChanges> changes_of(const std::vector<Recording>& recordings,
                                       RowMatX<double> Recording::* channel) {
  const int n = recordings.empty() ? 0 : recordings.front().num_joints();
  std::vector<ChannelChanges> out(static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j) {
    ChannelChanges& c = out[static_cast<std::size_t>(j)];
    for (const Recording& r : recordings) {
      long changed = -1, last = -1;
      for (long k = 0; k < r.rows(); ++k) {
        const double value = (r.*channel)(k, j);
        if (std::isnan(value)) continue;
        c.values.push_back(value);
        if (last >= 0 && value != (r.*channel)(last, j)) {
          c.changes.push_back(value - (r.*channel)(last, j));
          if (changed >= 0) c.moves.emplace_back(k - changed, std::abs(c.changes.back()));
          changed = k;
        }
        last = k;
      }
    }
  }
  return out;
}

}  // namespace

double quantisation_step(std::vector<double> v, const std::vector<double>& changes) {
  constexpr double kOnGrid = 0.05;  // distance from the grid over the step that counts as on it
  constexpr double kShare = 0.95;  // least share of changes on the grid; a tenth would be by chance
  std::ranges::sort(v);
  std::vector<double> gaps;
  const double rounding =
      v.empty() ? 0.0 : 1e-12 * std::max(std::abs(v.front()), std::abs(v.back()));
  for (std::size_t k = 1; k < v.size(); ++k)
    if (v[k] - v[k - 1] > rounding) gaps.push_back(v[k] - v[k - 1]);
  if (gaps.empty()) return 0.0;
  double step = quantile(gaps, 0.05);
  // A log of few digits rounds each step: changes of more and more steps tell it better.
  for (double most = 4.0; most < 1e4; most *= 2.0) {
    double sum = 0.0, squares = 0.0, largest = 0.0;
    for (const double c : changes) {
      const double steps = std::round(std::abs(c) / step);
      largest = std::max(largest, steps);
      if (steps > most) continue;
      sum += std::abs(c) * steps;
      squares += steps * steps;
    }
    if (squares > 0.0) step = sum / squares;
    if (most >= largest) break;
  }
  long on = 0;
  for (const double c : changes)
    on += std::abs(c / step - std::round(c / step)) < kOnGrid ? 1 : 0;
  return static_cast<double>(on) > kShare * static_cast<double>(changes.size()) ? step : 0.0;
}

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

std::vector<int> refresh_rows(const std::vector<Recording>& recordings,
                              RowMatX<double> Recording::*channel) {
  std::vector<int> out;
  for (const ChannelChanges& c : changes_of(recordings, channel))
    out.push_back(refresh_of(c.moves, quantisation_step(c.values, c.changes)));
  return out;
}

std::vector<double> quantisation_steps(const std::vector<Recording>& recordings) {
  std::vector<double> out;
  for (const ChannelChanges& c : changes_of(recordings, &Recording::q))
    out.push_back(quantisation_step(c.values, c.changes));
  return out;
}

void fill_stale(Eigen::Ref<VecX<double>> channel, int refresh) {
  if (refresh < 2) return;
  const std::vector<bool> is_new = refreshed(channel, refresh);
  long before = -1;
  double slope = 0.0;
  for (long k = 0; k < channel.size(); ++k) {
    if (!is_new[static_cast<std::size_t>(k)]) continue;
    if (before >= 0) {
      slope = (channel[k] - channel[before]) / static_cast<double>(k - before);
      for (long i = before + 1; i < k; ++i)
        channel[i] = channel[before] + slope * static_cast<double>(i - before);
    }
    before = k;
  }
  for (long i = before + 1; before >= 0 && i < channel.size(); ++i)
    channel[i] = channel[before] + slope * static_cast<double>(i - before);
}

}  // namespace diffnea
