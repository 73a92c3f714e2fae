#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>

#include <diffnea/experiment/seeds.hpp>

namespace diffnea {

std::vector<LearnedPolicy> learn_seeds(const BallInCup& task,
                                       const std::vector<std::uint64_t>& seeds, int threads,
                                       const SeedHooks& hooks) {
  const int count = static_cast<int>(seeds.size());
  const int searches = std::clamp(threads, 1, std::max(1, count));
  const int threads_each = std::max(1, threads / searches);
  std::vector<std::optional<LearnedPolicy>> found(seeds.size());
  std::atomic<int> next = 0;
  std::atomic<bool> stop = false;
  std::mutex one_at_a_time;
  std::exception_ptr failure;
  const auto work = [&] {
    for (int k = next++; k < count && !stop; k = next++) {
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
        const std::scoped_lock lock(one_at_a_time);
        if (!failure) failure = std::current_exception();
        stop = true;
      }
    }
  };
  {
    std::vector<std::jthread> others;
    for (int t = 1; t < searches; ++t) others.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
  std::vector<LearnedPolicy> out;
  for (std::optional<LearnedPolicy>& policy : found)
    if (policy) out.push_back(std::move(*policy));
  return out;
}

}  // namespace diffnea
