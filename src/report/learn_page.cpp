#include <algorithm>

#include <diffnea/report/learn_page.hpp>
#include <diffnea/report/learn_text.hpp>
#include <diffnea/runs/page_data.hpp>

#include "report/format.hpp"
#include "report/html.hpp"
#include "report/policy_words.hpp"

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

/// Numbers of all seeds over iterations.
std::string learning_curves(const LearnRun& run, int best) {
  struct Panel {
    const char *title, *key, *unit;
    std::string bound;
  };
  const ErepsOptions& o = run.task.options.ereps;
  std::string out = "<div class='evidence'>\n";
  for (const Panel& p :
       {Panel{"Mean reward of an iteration", "reward_mean", "reward", ""},
        Panel{"Best reward so far", "reward_best", "reward", ""},
        Panel{"Share of samples that catch the ball", "solved_share", "share", ""},
        Panel{"Entropy of the search", "entropy", "nat", ""},
        Panel{"KL of the samples' weights, and its bound", "kl_samples", "nat", number(o.epsilon)},
        Panel{"KL of the Gaussian's update, and its bound", "kl_update", "nat", number(o.kappa)}}) {
    Data data{{"key", p.key}, {"unit", p.unit}, {"best", std::to_string(best)}};
    if (!p.bound.empty()) data.emplace_back("bound", p.bound);
    out += "<figure>" + element("figcaption", p.title) + drawing("curve", data) + "</figure>\n";
  }
  return out + "</div>\n";
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
    body += movement("imagined", best, false, run.task.options.reward.string, true,
                     element("p",
                             "Arm, cup and ball from the side, where the model has them; the line "
                             "is the ball's way so far.",
                             "faint"));
  } else {
    body += element("p", "The folder holds no series.json, so that nothing can be drawn.", "faint");
  }
  if (std::ranges::any_of(run.policies, [](const LearnedPolicy& p) { return !p.curve.empty(); }))
    body += element("h2", "Learning curves") + learning_curves(run, best) +
            "<p class='faint'><span class='key fitted'></span>best policy<span class='key "
            "seed'></span>the other seeds<span class='key bound'></span>bound</p>\n";
  body += element("h2", "Seeds") + seeds_table(run, best) + element("h2", "Task") +
          task_table(run.task);
  const bool is_kept = run.figures.size() == run.policies.size();
  return document(title, body + reproduce(run.reproduce),
                  page_data(run, is_kept ? std::vector<int>{best} : std::vector<int>{}));
}

}  // namespace diffnea
