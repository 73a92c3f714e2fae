#pragma once
/// The same search from several seeds: one policy each, side by side.

#include <functional>
#include <optional>
#include <vector>

#include <diffnea/experiment/ball_in_cup.hpp>

namespace diffnea {

/// What the caller does while seeds are learned. Calls come from several threads, one at a time.
struct SeedHooks {
  /// A search to go on from; nothing: from the beginning.
  std::function<std::optional<SearchState>(std::uint64_t seed)> resume;
  /// After every iteration. @return false: all stop
  std::function<bool(std::uint64_t seed, const SearchState&)> iterated;
  /// When a seed is done.
  std::function<void(const LearnedPolicy&)> learned;
};

/// One policy a seed, in their order; those that were not begun when a hook said stop are left out.
/// Seeds are divided among the threads; where there are fewer seeds, rollouts are. The result does
/// not depend on it.
/// @throws what a search throws, after the others have stopped
std::vector<LearnedPolicy> learn_seeds(const BallInCup& task,
                                       const std::vector<std::uint64_t>& seeds, int threads,
                                       const SeedHooks& hooks = {});

}  // namespace diffnea
