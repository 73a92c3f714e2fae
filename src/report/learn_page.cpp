#include <diffnea/report/learn_page.hpp>
#include <diffnea/report/learn_text.hpp>

#include "report/format.hpp"
#include "report/html.hpp"
#include "report/page_parts.hpp"
#include "report/policy_charts.hpp"
#include "report/policy_words.hpp"
#include "report/stick_views.hpp"

namespace diffnea {
namespace {

using namespace report;

std::string caught_words(const LearnedPolicy& p) {
  std::string out = p.solved ? "caught" : "–";
  if (p.in_draws.count > 0)
    out += ", in " + std::to_string(p.in_draws.caught) + " of " + std::to_string(p.in_draws.count) +
           " draws";
  return out;
}

std::string seeds_table(const LearnRun& run, int best) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < run.policies.size(); ++i) {
    const LearnedPolicy& p = run.policies[i];
    const int captured = first_capture(p);
    const bool is_best = static_cast<int>(i) == best;
    rows.push_back({std::to_string(p.seed) + (is_best ? " <b>best</b>" : ""), caught_words(p),
                    reward_words(p.expected), captured > 0 ? std::to_string(captured) : "–",
                    std::to_string(p.curve.size()), std::to_string(p.rollouts),
                    duration_words(p.seconds),
                    p.stopped.empty() ? "interrupted" : escape(p.stopped)});
  }
  return html_table({"seed", "in the model", "reward", "first catch at iteration", "iterations",
                     "rollouts", "time", "stopped because"},
                    rows, {"", "", "n", "n", "n", "n", "n", "wrap"});
}

std::string models_words(const RobustOptions& o) {
  if (o.draws == 0) return "the identified one alone";
  std::string out = std::to_string(o.draws) + " draws of the posterior, every sample in " +
                    std::to_string(o.each) + "; its reward is " +
                    (o.quantile ? "the " + number(*o.quantile) + " quantile" : "the mean");
  for (const Variation& v : o.vary)
    out += "; " + v.parameter + " from " + number(v.low) + " to " + number(v.high);
  return out;
}

std::string task_table(const BallInCup& task) {
  const LearnOptions& o = task.options;
  std::string joints;
  for (const std::string& joint : o.promp.joints) joints += (joints.empty() ? "" : ", ") + joint;
  const auto row = [](const std::string& what, const std::string& value) {
    return std::vector<std::string>{escape(what), escape(value)};
  };
  std::vector<std::vector<std::string>> rows{
      row("joints that move", joints),
      row("movement", number(o.promp.duration) + " s, then " + number(o.promp.hold) +
                          " s at rest; " + std::to_string(Promp(o.promp).size()) + " weights"),
      row("search", std::to_string(o.ereps.samples) + " samples an iteration, at most " +
                        std::to_string(o.ereps.iterations) + " iterations; bounds " +
                        number(o.ereps.epsilon) + " and " + number(o.ereps.kappa) + " nat"),
      row("reward", "ε = " + number(o.reward.epsilon) + " m², λ_q = " + number(o.reward.lambda_q) +
                        ", λ_q̇ = " + number(o.reward.lambda_qd) +
                        ", λ_s = " + number(o.reward.lambda_slack)),
      row("string", number(o.reward.string) + " m"),
      row("models", models_words(o.robust))};
  if (const NetworkSource network = network_source(task); !network.sha256.empty())
    rows.push_back(row("ball moved by the network",
                       network.file + ", SHA-256 " + network.sha256.substr(0, 12)));
  return html_table({"", ""}, rows, {"", ""});
}

}  // namespace

std::string learn_page(const LearnRun& run) {
  const int best = best_policy(run.policies);
  const std::string name = run.task.model.name.empty() ? "model" : run.task.model.name;
  const std::string title = "Ball in a cup, learned in " + name;
  std::string body = element("h1", title) + element("p", learn_headline(run), "headline");
  if (run.interrupted)
    body +=
        element("p", "The search was interrupted: policies are what had been learned until then.",
                "warning");
  body += element("h2", "The best policy's movement in the model");
  if (best >= 0 && best < static_cast<int>(run.figures.size())) {
    const StickFigure& figure = run.figures[static_cast<std::size_t>(best)];
    body += film_strip(figure, nullptr, run.task.options.reward.string) +
            element("p",
                    "Arm, cup and ball from the side, where the model has them; the line is the "
                    "ball's way so far.",
                    "faint") +
            player(figure, nullptr, run.task.options.reward.string);
  } else {
    body += element("p", "The folder holds no series.json, so that nothing can be drawn.", "faint");
  }
  body += element("h2", "Learning curves") +
          learning_curves(run.policies, run.task.options.ereps, best) +
          "<p class='faint'><span class='key fitted'></span>best policy<span class='key "
          "seed'></span>the other seeds<span class='key bound'></span>bound</p>\n";
  body += element("h2", "Seeds") + seeds_table(run, best) + element("h2", "Task") +
          task_table(run.task);
  body += element("h2", "How to get this again") + reproduce(run.reproduce);
  return document(title, body, "{}");
}

}  // namespace diffnea
