#include <cmath>

#include <diffnea/report/transfer_page.hpp>
#include <diffnea/report/transfer_text.hpp>
#include <diffnea/runs/page_data.hpp>

#include "report/format.hpp"
#include "report/html.hpp"
#include "report/policy_words.hpp"

namespace diffnea {
namespace {

using namespace report;

std::string policies_table(const TransferRun& run) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < run.executions.size(); ++i) {
    const Execution& e = run.executions[i];
    const LearnedPolicy& p = run.policies.at(i);
    const PathError error =
        path_error(i < run.imagined.size() ? run.imagined[i] : RolloutTrace{}, e.trace);
    rows.push_back(
        {std::to_string(p.seed) + (static_cast<int>(i) == run.best ? " <b>best</b>" : ""),
         p.solved ? "caught" : "–",
         e.success() ? "<b class='good'>caught</b>" : "<b class='bad'>not</b>",
         escape(outcome_words(e)), reward_words(p.expected), reward_words(e.reward),
         reward_words(e.reward_wide), number(1e3 * error.at_capture, 3),
         number(1e3 * error.rms, 3)});
  }
  return html_table(
      {"seed", "in the model", "in the world", "what happened", "reward expected", "obtained",
       "(ε = 0.055)", "ball's error at the catch mm", "until then, rms mm"},
      rows, {"", "", "", "wrap", "n", "n", "n", "n", "n"});
}

const std::string kLegend =
    "<p class='faint'><span class='key fitted'></span>ball in the world<span class='key "
    "imagined'></span>as the model imagined it</p>\n";

bool is_kept(const TransferRun& run) {
  return run.figures.size() == run.executions.size() &&
         run.imagined_figures.size() >= run.executions.size();
}

std::string movement(const TransferRun& run, int index, const std::string& title, bool plays) {
  if (index < 0 || !is_kept(run)) return "";
  const std::size_t i = static_cast<std::size_t>(index);
  return "<section>" +
         element("h2", title + ": seed " + std::to_string(run.policies.at(i).seed) + ", " +
                           outcome_words(run.executions[i])) +
         report::movement("obtained", index, run.imagined_figures[i].time.size() > 0,
                          run.task.options.reward.string, plays, kLegend) +
         "<h3>Distance of the ball from the cup <small>[m]</small></h3>\n" + kLegend +
         drawing("distance", {{"index", std::to_string(index)}}) + "</section>\n";
}

bool has_rewards(const TransferRun& run) {
  for (std::size_t i = 0; i < run.executions.size(); ++i)
    if (std::isfinite(run.executions[i].reward) || std::isfinite(run.policies.at(i).expected))
      return true;
  return false;
}

std::string repetitions(const TransferRun& run) {
  if (run.repetitions.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const Execution& e : run.repetitions)
    rows.push_back({std::to_string(e.seed), e.success() ? "caught" : "not",
                    escape(outcome_words(e)), reward_words(e.reward)});
  return "<details><summary>" + std::to_string(rows.size()) +
         " repetitions of the best, with noise</summary>\n" +
         html_table({"noise", "", "what happened", "reward"}, rows, {"", "", "wrap", "n"}) +
         "</details>\n";
}

}  // namespace

std::string transfer_page(const TransferRun& run) {
  const std::string name = run.task.model.name.empty() ? "the model" : run.task.model.name;
  const std::string title = "Ball in a cup, from " + name + " to another world";
  std::string body = element("h1", title) + element("p", transfer_headline(run), "headline");
  if (run.differences) body += element("p", world_sentence(run));
  if (run.interrupted)
    body += element("p",
                    "Interrupted: " + std::to_string(run.executions.size()) + " of " +
                        std::to_string(run.policies.size()) + " policies were executed.",
                    "warning");
  const Telling shown = telling(run);
  body += movement(run, shown.success, "Best success", true);
  body += element("h2", "Policies") + policies_table(run) + repetitions(run);
  if (has_rewards(run))
    body += element("h2", "Reward, expected and obtained") + drawing("scatter", {}) +
            "<p class='faint'><span class='key fitted'></span>caught<span class='key "
            "nominal'></span>not caught; on the line the world is as the model says</p>\n";
  body += movement(run, shown.failure, "Worst failure", shown.success < 0);
  return document(title, body + reproduce(run.reproduce),
                  page_data(run, is_kept(run) ? std::vector<int>{shown.success, shown.failure}
                                              : std::vector<int>{}));
}

}  // namespace diffnea
