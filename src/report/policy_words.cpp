#include "report/policy_words.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/c_numbers.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {

std::string share_words(const Share& s, const char* of) {
  const std::string counts = std::to_string(s.k) + " of " + std::to_string(s.n) + " " + of;
  if (s.n == 0) return counts;
  char text[80];
  detail::print(text, sizeof text, " (%.0f %%, 95 %% interval %.0f–%.0f %%)",
                100.0 * s.k / static_cast<double>(s.n), 100.0 * s.low, 100.0 * s.high);
  return counts + text;
}

std::string outcome_words(const Execution& e) {
  return e.failure.empty() ? e.verdict.text : "failed: " + e.failure;
}

std::string reward_words(double reward) { return std::isfinite(reward) ? number(reward, 3) : "–"; }

std::string duration_words(double seconds) {
  if (!(seconds >= 120.0)) return number(seconds, 2) + " s";
  return seconds < 7200.0 ? number(seconds / 60.0, 2) + " min" : number(seconds / 3600.0, 2) + " h";
}

Share solved_share(const std::vector<LearnedPolicy>& policies) {
  return share_of(static_cast<int>(std::ranges::count(policies, true, &LearnedPolicy::solved)),
                  static_cast<int>(policies.size()));
}

Share success_share(const std::vector<Execution>& executions) {
  return share_of(static_cast<int>(std::ranges::count_if(executions, &Execution::success)),
                  static_cast<int>(executions.size()));
}

std::string movement(const char* list, int index, bool ghost, double string, bool plays,
                     const std::string& legend) {
  Data data{{"movement", list}, {"index", std::to_string(index)}, {"string", number(string, 7)}};
  if (ghost) data.emplace_back("ghost", "");
  return drawing("strip", data) + "\n" + legend +
         (plays ? drawing("player", data, "player") + "\n" : "");
}

Telling telling(const TransferRun& run) {
  // What the model had promised tells more than what it had not.
  const auto badness = [&](int i) {
    const std::size_t k = static_cast<std::size_t>(i);
    return std::pair(run.policies.at(k).solved, -run.executions[k].reward);
  };
  Telling out;
  for (int i = 0; i < static_cast<int>(run.executions.size()); ++i) {
    const Execution& e = run.executions[static_cast<std::size_t>(i)];
    if (e.trace.time.size() == 0) continue;
    int& place = e.success() ? out.success : out.failure;
    if (place < 0 ||
        (e.success() ? e.reward > run.executions[static_cast<std::size_t>(place)].reward
                     : badness(i) > badness(place)))
      place = i;
  }
  return out;
}

}  // namespace diffnea::report
