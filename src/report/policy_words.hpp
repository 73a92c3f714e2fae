#pragma once
/// How runs of policies are put into words, for the page and the terminal; movements on a page.

#include <string>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea::report {

/// "7 of 10 policies (70 %, 95 % interval 40–89 %)"
std::string share_words(const Share& share, const char* of);
/// "in the cup since 1.32 s"; "failed: …"
std::string outcome_words(const Execution& execution);
/// Three digits; "–" for that of a motion that could not be executed, −∞.
std::string reward_words(double reward);
/// "3.2 s", "4.1 min"
std::string duration_words(double seconds);
Share solved_share(const std::vector<LearnedPolicy>& policies);
Share success_share(const std::vector<Execution>& executions);

/// Places of a movement's drawings: frames side by side, a legend, one that plays.
/// @param list   of the page's data: "imagined", "obtained"  @param index  of the policy
/// @param ghost  with the ball as it was imagined  @param string  its length [m]; 0: none
std::string movement(const char* list, int index, bool ghost, double string, bool plays,
                     const std::string& legend);

/// Indices into executions: the success with the largest reward; the failure with the smallest,
/// of those that succeed in the model if there are such; −1: none.
struct Telling {
  int success = -1, failure = -1;
};
Telling telling(const TransferRun& run);

}  // namespace diffnea::report
