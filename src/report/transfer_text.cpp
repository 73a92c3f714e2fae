#include <diffnea/report/transfer_text.hpp>

#include "report/format.hpp"
#include "report/policy_words.hpp"

namespace diffnea {

using namespace report;

std::string transfer_headline(const TransferRun& run) {
  if (run.executions.empty()) return "No policy was executed.";
  const bool one = run.executions.size() == 1;
  std::string out = share_words(success_share(run.executions), one ? "policy" : "policies") +
                    (one ? " catches" : " catch") + " the ball in " + run.world;
  if (!run.repetitions.empty() && run.best >= 0)
    out += "; the best, of seed " +
           std::to_string(run.policies.at(static_cast<std::size_t>(run.best)).seed) +
           ", does so in " + share_words(success_share(run.repetitions), "repetitions with noise");
  return out + ".";
}

std::string world_sentence(const TransferRun& run) {
  if (!run.differences) return "";
  if (run.differences->empty()) return "The world is as its description says.";
  std::string out;
  for (const std::string& clause : *run.differences) out += (out.empty() ? "" : "; ") + clause;
  return "The world differs from its description: " + out + ".";
}

std::string transfer_text(const TransferRun& run) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < run.executions.size(); ++i) {
    const Execution& e = run.executions[i];
    const LearnedPolicy& p = run.policies.at(i);
    const PathError error =
        i < run.imagined.size() ? path_error(run.imagined[i], e.trace) : path_error({}, e.trace);
    rows.push_back({std::to_string(p.seed), p.solved ? "yes" : "no", e.success() ? "yes" : "no",
                    reward_words(p.expected), reward_words(e.reward), reward_words(e.reward_wide),
                    number(1e3 * error.at_capture, 3), outcome_words(e)});
  }
  return table({"seed", "<in the model", "<caught", "expected", "reward", "(wide)", "error mm",
                "<what happened"},
               rows) +
         "\n" + transfer_headline(run) + "\n" + (run.differences ? world_sentence(run) + "\n" : "");
}

}  // namespace diffnea
