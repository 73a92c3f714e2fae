#include "diagnose/window_case.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/random.hpp>

#include "diagnose/thresholds.hpp"

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
  const auto& [before, after, numbers] = blocks;
  const double n = std::max(numbers, 1.0);
  HeldOutChange out;
  for (const double e : before) out.before += e / n;
  for (const double e : after) out.after += e / n;
  Rng rng(seed);
  std::vector<double> shares;
  for (int i = 0; i < kResamples; ++i) {
    double less = 0.0, more = 0.0;
    for (std::size_t w = 0; w < before.size(); ++w) {
      const auto pick =
          std::min(before.size() - 1, static_cast<std::size_t>(
                                          rng.uniform() * static_cast<double>(before.size())));
      less += before[pick];
      more += after[pick];
    }
    shares.push_back((less - more) / std::max(less, 1e-300));
  }
  std::ranges::sort(shares);
  out.low = shares[static_cast<std::size_t>(0.025 * kResamples)];
  out.high = shares[static_cast<std::size_t>(0.975 * kResamples)];
  return out;
}

}  // namespace diffnea
