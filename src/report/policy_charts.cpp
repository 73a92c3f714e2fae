#include "report/policy_charts.hpp"

#include <array>
#include <cmath>
#include <limits>

#include "report/chart.hpp"
#include "report/format.hpp"
#include "report/html.hpp"
#include "report/svg.hpp"

namespace diffnea::report {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Panel {
  const char* title;
  const char* y_title;
  double ErepsIteration::* value;
  double bound;  ///< NaN: none
};

std::vector<double> list(const VecX<double>& x) { return {x.begin(), x.end()}; }

VecX<double> to_cup(const RolloutTrace& trace) {
  if (trace.time.size() == 0) return {};
  return (points_of(trace, "ball") - points_of(trace, "cup")).rowwise().norm();
}

}  // namespace

std::string learning_curves(const std::vector<LearnedPolicy>& policies, const ErepsOptions& options,
                            int bold) {
  const std::array<Panel, 6> panels{
      {{"Mean reward of an iteration", "reward", &ErepsIteration::reward_mean, kNaN},
       {"Best reward so far", "reward", &ErepsIteration::reward_best, kNaN},
       {"Share of samples that catch the ball", "share", &ErepsIteration::solved_share, kNaN},
       {"Entropy of the search", "nat", &ErepsIteration::entropy, kNaN},
       {"KL of the samples' weights, and its bound", "nat", &ErepsIteration::kl_samples,
        options.epsilon},
       {"KL of the Gaussian's update, and its bound", "nat", &ErepsIteration::kl_update,
        options.kappa}}};
  std::size_t longest = 0;
  for (const LearnedPolicy& p : policies) longest = std::max(longest, p.curve.size());
  if (longest == 0) return "";
  std::vector<double> iterations(longest);
  for (std::size_t i = 0; i < longest; ++i) iterations[i] = static_cast<double>(i + 1);
  const std::vector<double> none(longest, kNaN);
  std::string out = "<div class='evidence'>\n";
  for (const Panel& panel : panels) {
    std::vector<std::vector<double>> columns(policies.size() + 1, none);
    for (std::size_t p = 0; p < policies.size(); ++p)
      for (std::size_t i = 0; i < policies[p].curve.size(); ++i)
        columns[p][i] = policies[p].curve[i].*panel.value;
    std::vector<Band> bands;
    for (std::size_t p = 0; p < policies.size(); ++p)
      if (static_cast<int>(p) != bold) bands.push_back({"seed", &columns[p], &none, &none});
    if (bold >= 0)
      bands.push_back({"fitted", &columns[static_cast<std::size_t>(bold)], &none, &none});
    if (std::isfinite(panel.bound)) {
      columns.back().assign(longest, panel.bound);
      bands.push_back({"bound", &columns.back(), &none, &none});
    }
    out += "<figure>" + element("figcaption", panel.title) +
           band_chart(iterations, bands, "iteration", panel.y_title, kNaN) + "</figure>\n";
  }
  return out + "</div>\n";
}

std::string reward_scatter(const TransferRun& run) {
  constexpr double kSize = 380.0, kLeft = 52.0, kBottom = 36.0, kTop = 12.0;
  Range range;
  for (std::size_t i = 0; i < run.executions.size(); ++i) {
    range.take(run.policies.at(i).expected);
    range.take(run.executions[i].reward);
  }
  if (range.empty()) return "";
  range = range.widened(0.08);
  const double side = kSize - kBottom - kTop;
  const auto to_x = [&](double v) { return kLeft + (v - range.low) / range.width() * side; };
  const auto to_y = [&](double v) {
    return kSize - kBottom - (v - range.low) / range.width() * side;
  };
  std::string out = "<svg class='scatter' viewBox='0 0 " + coordinate(kLeft + side + 12) + " " +
                    coordinate(kSize) + "' role='img'>";
  for (const double t : ticks(range, 5))
    out += segment("grid", kLeft, to_y(t), kLeft + side, to_y(t)) +
           segment("grid", to_x(t), kTop, to_x(t), kTop + side) +
           text_at(kLeft - 5, to_y(t) + 4, "end", number(t)) +
           text_at(to_x(t), kTop + side + 14, "middle", number(t));
  out += segment("zero", to_x(range.low), to_y(range.low), to_x(range.high), to_y(range.high)) +
         text_at(kLeft + 0.5 * side, kSize - 5, "middle", "reward expected in the model") +
         text_at(kLeft + 4, kTop + 10, "start", "reward obtained");
  for (std::size_t i = 0; i < run.executions.size(); ++i) {
    const Execution& e = run.executions[i];
    const double x = run.policies[i].expected;
    if (!std::isfinite(x) || !std::isfinite(e.reward)) continue;
    out += std::string("<circle class='") + (e.success() ? "caught" : "lost") + "' cx='" +
           coordinate(to_x(x)) + "' cy='" + coordinate(to_y(e.reward)) + "' r='4.5'/>";
  }
  return out + "</svg>\n";
}

std::string distance_chart(const RolloutTrace& imagined, const RolloutTrace& obtained) {
  if (obtained.time.size() == 0) return "";
  const std::vector<double> time = list(obtained.time), in_world = list(to_cup(obtained));
  const VecX<double> model = to_cup(imagined);
  std::vector<double> in_model(time.size(), kNaN);  // on the same axis; rows come at one rate
  long k = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    while (k < imagined.time.size() && imagined.time[k] < time[i] - 1e-6) ++k;
    if (k < imagined.time.size()) in_model[i] = model[k];
  }
  return line_chart(time, {{"imagined", &in_model}, {"fitted", &in_world}},
                    {time.front(), time.back()}, "m", 230, 900);
}

}  // namespace diffnea::report
