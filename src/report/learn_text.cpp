#include <algorithm>
#include <cmath>

#include <diffnea/report/learn_text.hpp>

#include "report/format.hpp"
#include "report/policy_words.hpp"

namespace diffnea {

using namespace report;

namespace {

/// ", and in 91 % of 64 draws …", of all policies; empty where none was learned in draws.
std::string draws_words(const std::vector<LearnedPolicy>& policies) {
  int draws = 0, caught = 0;
  for (const LearnedPolicy& p : policies) {
    draws += p.in_draws.count;
    caught += p.in_draws.caught;
  }
  if (draws == 0) return "";
  return ", and in " + number(100.0 * caught / draws, 3) + " % of " + std::to_string(draws) +
         (policies.size() == 1 ? " draws" : " pairs of policy and draw") +
         " of the posterior that no search had seen";
}

}  // namespace

std::string learn_headline(const LearnRun& run) {
  if (run.policies.empty()) return "Nothing was learned.";
  std::vector<double> seconds;
  long rollouts = 0;
  for (const LearnedPolicy& p : run.policies) {
    seconds.push_back(p.seconds);
    rollouts += p.rollouts;
  }
  const std::size_t n = seconds.size();
  std::erase_if(seconds, [](double x) { return std::isnan(x); });
  std::ranges::sort(seconds);
  const std::size_t known = seconds.size();
  const double median =
      known > 0 ? 0.5 * (seconds[(known - 1) / 2] + seconds[known / 2]) : std::nan("");
  const Share solved = solved_share(run.policies);
  const NetworkSource network = network_source(run.task);
  const std::string moved = network.sha256.empty()
                                ? ""
                                : " There the ball was moved by the network " + network.file + ".";
  return std::to_string(solved.k) + " of " + std::to_string(solved.n) +
         (n == 1 ? " policy catches" : " policies catch") + " the ball in the model" +
         draws_words(run.policies) + "; " + duration_words(median) +
         (n == 1 ? " and " : " (median) a seed, ") + std::to_string(rollouts) +
         " rollouts in all." + moved;
}

std::string learn_text(const LearnRun& run) {
  std::vector<std::vector<std::string>> rows;
  for (const LearnedPolicy& p : run.policies) {
    const int captured = first_capture(p);
    std::string caught = p.solved ? "yes" : "no";
    if (p.in_draws.count > 0)
      caught += ", in " + std::to_string(p.in_draws.caught) + " of " +
                std::to_string(p.in_draws.count) + " draws";
    rows.push_back({std::to_string(p.seed), caught, reward_words(p.expected),
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
