#include <algorithm>
#include <atomic>
#include <mutex>

#include <diffnea/core/parallel.hpp>
#include <diffnea/experiment/seeds.hpp>

namespace diffnea {

std::vector<LearnedPolicy> learn_seeds(const BallInCup& task,
                                       const std::vector<std::uint64_t>& seeds, int threads,
                                       const SeedHooks& hooks) {
  const int count = static_cast<int>(seeds.size());
  const int searches = std::clamp(threads, 1, std::max(1, count));
  const int threads_each = std::max(1, threads / searches);
  std::vector<std::optional<LearnedPolicy>> found(seeds.size());
  std::atomic<bool> stop = false;
  std::mutex one_at_a_time;
  parallel_for(seeds.size(), static_cast<std::size_t>(searches), [&](std::size_t k, std::size_t) {
    if (stop) return;
    try {
      std::optional<SearchState> from;
      if (hooks.resume) {
        const std::scoped_lock lock(one_at_a_time);
        from = hooks.resume(seeds[k]);
      }
      const LearnProgress progress = [&](const SearchState& state) {
        const std::scoped_lock lock(one_at_a_time);
        if (hooks.iterated && !hooks.iterated(seeds[k], state)) stop = true;
        return !stop;
      };
      found[k] = learn(task, seeds[k], threads_each, progress, from ? &*from : nullptr);
      const std::scoped_lock lock(one_at_a_time);
      if (hooks.learned) hooks.learned(*found[k]);
    } catch (...) {
      stop = true;  // the searches that go on end at their next iteration
      throw;
    }
  });
  std::vector<LearnedPolicy> out;
  for (std::optional<LearnedPolicy>& policy : found)
    if (policy) out.push_back(std::move(*policy));
  return out;
}

}  // namespace diffnea
