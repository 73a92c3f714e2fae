#include "diagnose/window_case.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "diagnose/resampling.hpp"

namespace diffnea {

bool same_effect(const EffectSpec& a, const EffectSpec& b) {
  return a.effect == b.effect && a.where == b.where;
}
bool holds_effect(const std::vector<EffectSpec>& terms, const EffectSpec& e) {
  return std::ranges::any_of(terms, [&](const EffectSpec& t) { return same_effect(t, e); });
}
std::vector<EffectSpec> with_effect(std::vector<EffectSpec> terms, const EffectSpec& more) {
  terms.push_back(more);
  return terms;
}
std::vector<EffectSpec> without_effect(std::vector<EffectSpec> terms, const EffectSpec& less) {
  std::erase_if(terms, [&](const EffectSpec& t) { return same_effect(t, less); });
  return terms;
}

std::vector<std::string> names_of(const std::vector<EffectSpec>& terms) {
  std::vector<std::string> out;
  for (const EffectSpec& t : terms) out.push_back(t.where + "." + t.effect);
  std::ranges::sort(out);
  return out;
}

double window_delta_bic(double less, double more, double n, double correlation,
                        double parameters) {
  return n / correlation * std::log(less / more) - parameters * std::log(n);
}

HeldOutChange change_over(const HeldOutBlocks& blocks, std::uint64_t seed) {
  HeldOutChange out;
  std::vector<std::array<double, 2>> squares;
  for (std::size_t b = 0; b < blocks.before.size(); ++b) {
    squares.push_back({blocks.before[b], blocks.after[b]});
    out.before += blocks.before[b] / std::max(blocks.n, 1.0);
    out.after += blocks.after[b] / std::max(blocks.n, 1.0);
  }
  std::vector<double> shares;
  for (const auto& [before, after] : bootstrap(squares, Rng(seed)))
    shares.push_back((before - after) / std::max(before, 1e-300));
  std::tie(out.low, out.high) = interval(std::move(shares));
  return out;
}

}  // namespace diffnea
