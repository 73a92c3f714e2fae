#include "recording/between.hpp"

#include <algorithm>

#include <diffnea/recording/refresh.hpp>

namespace diffnea::detail {

std::vector<long> rows_of(const std::vector<bool>& marked) {
  std::vector<long> out;
  for (std::size_t k = 0; k < marked.size(); ++k)
    if (marked[k]) out.push_back(static_cast<long>(k));
  return out;
}

double between(const VecX<double>& at, const VecX<double>& y, const std::vector<long>& known,
               long row) {
  const auto after = std::ranges::upper_bound(known, row);
  const long next = after - known.begin();
  const auto first = known.begin() + std::max(0L, next - kEachSide),
             last = known.begin() + std::min<long>(std::ssize(known), next + kEachSide);
  double out = 0.0;
  for (auto i = first; i != last; ++i) {
    double weight = 1.0;
    for (auto j = first; j != last; ++j)
      if (j != i) weight *= (at[row] - at[*j]) / (at[*i] - at[*j]);
    out += weight * y[*i];
  }
  return out;
}

void curve_stale(Eigen::Ref<VecX<double>> channel, int refresh) {
  if (refresh < 2) return;
  const std::vector<long> known = rows_of(refreshed(channel, refresh));
  if (known.empty()) return;
  fill_stale(channel, refresh);
  const VecX<double> y = channel, at = VecX<double>::LinSpaced(
                                      channel.size(), 0.0, static_cast<double>(channel.size() - 1));
  for (std::size_t i = 1; i < known.size(); ++i)
    for (long k = known[i - 1] + 1; k < known[i]; ++k) channel[k] = between(at, y, known, k);
}

}  // namespace diffnea::detail
