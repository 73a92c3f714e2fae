#include "diagnose/spread_windows.hpp"

#include <algorithm>
#include <cmath>

namespace diffnea {
namespace {

/// Shortest of the windows over the horizon.
constexpr double kNearly = 0.9;

/// Index of the first row that is later than a time.
long later_than(const MotionStretch& s, double time) {
  return std::upper_bound(s.time.begin(), s.time.end(), time) - s.time.begin();
}

/// The window from a row on, as long as the horizon or nearly; no rows: there is none.
MotionWindow window_from(const MotionStretch& s, std::size_t stretch, long first, double horizon) {
  const double from = s.time[first];
  const long end = later_than(s, from + horizon * (1.0 + 1e-9));
  const bool long_enough = s.time.back() - from >= kNearly * horizon;
  return {stretch, first, long_enough && end - first > 2 ? end - first : 0, {}};
}

}  // namespace

std::vector<MotionWindow> spread_windows(const std::vector<MotionStretch>& stretches,
                                         double horizon, std::size_t most) {
  std::vector<std::size_t> order(stretches.size());
  for (std::size_t s = 0; s < order.size(); ++s) order[s] = s;
  std::ranges::stable_sort(order, std::greater<>{},
                           [&](std::size_t s) { return stretches[s].length(); });
  if (order.size() > most) order.resize(most);
  std::ranges::sort(order);
  double all = 0.0;
  for (const std::size_t s : order) all += stretches[s].length();
  std::vector<MotionWindow> out;
  for (const std::size_t k : order) {
    const MotionStretch& s = stretches[k];
    const double share = s.length() / std::max(all, 1e-300);
    const double count = std::max(1.0, std::floor(share * static_cast<double>(most)));
    const double step = std::max(horizon, s.length() / count);
    for (double t = s.time.front(); t < s.time.back(); t += step) {
      const long first = later_than(s, t + 1e-9 * step) - 1;
      const MotionWindow w = window_from(s, k, first, horizon);
      if (w.rows > 0) out.push_back(w);
    }
  }
  return out;
}

std::vector<MotionWindow> lengthened(const std::vector<MotionStretch>& stretches,
                                     const std::vector<MotionWindow>& windows, double horizon,
                                     double most) {
  std::vector<MotionWindow> out;
  for (const MotionWindow& from : windows) {
    const bool overlaps = !out.empty() && out.back().stretch == from.stretch &&
                          from.first < out.back().first + out.back().rows - 1;
    if (overlaps) continue;
    const MotionWindow w = window_from(stretches[from.stretch], from.stretch, from.first, horizon);
    if (w.rows > 0) out.push_back(w);
  }
  long rows = 0;
  for (const MotionWindow& w : out) rows += w.rows;
  const double joints = static_cast<double>(stretches.front().q.cols()),
               share = most / (static_cast<double>(std::max(rows, 1L)) * joints * joints);
  const std::size_t fewer = std::max<std::size_t>(
      1, static_cast<std::size_t>(static_cast<double>(out.size()) * std::min(1.0, share)));
  if (fewer >= out.size()) return out;
  // The longest stretch's first window is the only one that may become as long as it.
  const auto longest = std::ranges::max_element(
      out, {}, [&](const MotionWindow& w) { return stretches[w.stretch].length(); });
  std::vector<std::size_t> some;
  for (std::size_t i = 0; i < fewer; ++i) some.push_back(i * out.size() / fewer);
  const std::size_t needed = static_cast<std::size_t>(longest - out.begin());
  if (std::ranges::find(some, needed) == some.end()) some.back() = needed;
  std::ranges::sort(some);
  std::vector<MotionWindow> kept;
  for (const std::size_t i : some) kept.push_back(out[i]);
  return kept;
}

}  // namespace diffnea
