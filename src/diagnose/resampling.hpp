#pragma once
/// Draws with and without replacement, and what is certain of them. Internal to diagnose/.

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include <diffnea/core/random.hpp>

#include "diagnose/thresholds.hpp"

namespace diffnea {

/// An index below `count`, each alike.
inline std::size_t draw(Rng& rng, std::size_t count) {
  return static_cast<std::size_t>(rng.uniform() * static_cast<double>(count));
}

/// All orders alike (Fisher, Yates).
inline void shuffle(std::vector<std::size_t>& order, Rng& rng) {
  for (std::size_t i = order.size(); i-- > 1;) std::swap(order[i], order[draw(rng, i + 1)]);
}

/// Sums over blocks that are drawn with replacement (Künsch 1989), kResamples times.
/// @param of  several numbers of each block
template <std::size_t N>
std::vector<std::array<double, N>> bootstrap(const std::vector<std::array<double, N>>& of,
                                             Rng rng) {
  std::vector<std::array<double, N>> out(kResamples, std::array<double, N>{});
  for (std::array<double, N>& sums : out)
    for (std::size_t b = 0; b < of.size(); ++b) {
      const std::array<double, N>& block = of[draw(rng, of.size())];
      for (std::size_t k = 0; k < N; ++k) sums[k] += block[k];
    }
  return out;
}

/// Ends of the 95 % interval of kResamples draws.
inline std::pair<double, double> interval(std::vector<double> draws) {
  std::ranges::sort(draws);
  return {draws[static_cast<std::size_t>(0.025 * kResamples)],
          draws[static_cast<std::size_t>(0.975 * kResamples)]};
}

}  // namespace diffnea
