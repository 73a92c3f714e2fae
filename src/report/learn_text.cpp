#include <algorithm>

#include <diffnea/report/learn_text.hpp>

#include "report/format.hpp"
#include "report/policy_words.hpp"

namespace diffnea {

using namespace report;

std::string learn_headline(const LearnRun& run) {
  if (run.policies.empty()) return "Nothing was learned.";
  std::vector<double> seconds;
  long rollouts = 0;
  for (const LearnedPolicy& p : run.policies) {
    seconds.push_back(p.seconds);
    rollouts += p.rollouts;
  }
  std::ranges::sort(seconds);
  const std::size_t n = seconds.size();
  const double median = 0.5 * (seconds[(n - 1) / 2] + seconds[n / 2]);
  const Share solved = solved_share(run.policies);
  const NetworkSource network = network_source(run.task);
  const std::string moved = network.sha256.empty()
                                ? ""
                                : " There the ball was moved by the network " + network.file + ".";
  return std::to_string(solved.k) + " of " + std::to_string(solved.n) +
         (n == 1 ? " policy catches" : " policies catch") + " the ball in the model; " +
         duration_words(median) + (n == 1 ? " and " : " (median) a seed, ") +
         std::to_string(rollouts) + " rollouts in all." + moved;
}

std::string learn_text(const LearnRun& run) {
  std::vector<std::vector<std::string>> rows;
  for (const LearnedPolicy& p : run.policies) {
    const int captured = first_capture(p);
    rows.push_back({std::to_string(p.seed), p.solved ? "yes" : "no", reward_words(p.expected),
                    captured > 0 ? std::to_string(captured) : "–", std::to_string(p.curve.size()),
                    std::to_string(p.rollouts), number(p.seconds, 3),
                    p.stopped.empty() ? "interrupted" : p.stopped});
  }
  return table({"seed", "<caught", "reward", "first catch", "iterations", "rollouts", "s",
                "<stopped because"},
               rows) +
         "\n" + learn_headline(run) + "\n";
}

}  // namespace diffnea
