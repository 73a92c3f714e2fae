#pragma once
/// Jobs shared out among threads.

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace diffnea {

/// Calls job(k, worker) once for every k < count. Workers are numbered from 0 and have a thread
/// each, the caller's among them.
/// @param threads  at most; 0 counts as 1
/// @throws what a job threw first; no other begins after it, and all have ended
template <class Job>
void parallel_for(std::size_t count, std::size_t threads, const Job& job) {
  std::atomic<std::size_t> next{0};
  std::mutex one_at_a_time;
  std::exception_ptr failure;
  const auto work = [&](std::size_t worker) {
    try {
      for (std::size_t k = next++; k < count; k = next++) job(k, worker);
    } catch (...) {
      const std::scoped_lock lock(one_at_a_time);
      if (!failure) failure = std::current_exception();
      next = count;
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t w = 1; w < std::min(threads, count); ++w) others.emplace_back(work, w);
    work(0);
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace diffnea
