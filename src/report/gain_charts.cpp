#include "report/gain_charts.hpp"

#include <algorithm>
#include <cmath>

#include "report/chart.hpp"
#include "report/diagnose_words.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {

std::string waterfall(const Finding& f) {
  const Gain& g = f.gain;
  const double first = g.before * g.before, last = g.after * g.after;
  if (!std::isfinite(first) || !std::isfinite(last)) return "";
  std::vector<Bar> bars{{"base model", number(g.before, 3) + " × noise", 0.0, first, "base"}};
  double level = first;
  const auto step = [&](const std::string& label, double removed) {
    bars.push_back({label, "− " + percent(removed / first), level - removed, level, "removed"});
    level -= removed;
  };
  for (const Cause& c : f.causes)
    step(at(c.effect, c.where), c.gain.before * c.gain.before - c.gain.after * c.gain.after);
  // Effects overlap: what they remove together need not be the sum of what each removes alone.
  if (!f.causes.empty() && std::abs(level - last) > 0.01 * first)
    step("together, beyond each alone", level - last);
  if (!f.causes.empty())
    bars.push_back({"extended model", number(g.after, 3) + " × noise", 0.0, last, "after"});
  bars.push_back({"noise floor", number(g.noise_floor, 3) + " × noise", 0.0,
                  g.noise_floor * g.noise_floor, "floor"});
  return "<p class='faint'>Mean square of the held-out " + error_of(f) +
         ", each channel in units of its "
         "noise; what every cause removes with the others in place.</p>\n" +
         bar_chart(bars);
}

std::string joint_table(const Finding& f) {
  const bool one = f.causes.empty();
  const bool torque = std::ranges::any_of(f.joints, [](const JointGain& j) { return !is_ball(j); });
  std::vector<std::vector<std::string>> rows;
  for (const JointGain& j : f.joints) {
    const bool ball = is_ball(j);
    const double scale = ball ? 1e3 : 1.0;
    std::vector<std::string> row{escape(j.joint), ball ? "mm" : escape(unit(j.unit))};
    const auto put_share = [&](double x) {
      if (torque) row.push_back(ball ? "" : percent(x / j.torque_rms));
    };
    if (torque) row.push_back(ball ? "" : number(j.torque_rms, 3));
    row.push_back(number(scale * j.noise_floor, 3));
    row.push_back(number(scale * j.base, 3));
    put_share(j.base);
    if (!one) {
      row.push_back("<b>" + number(scale * j.extended, 3) + "</b>");
      put_share(j.extended);
    }
    rows.push_back(row);
  }
  std::vector<std::string> titles{"joint", "unit"};
  if (torque) titles.push_back("rms torque");
  titles.insert(titles.end(), {"noise", "base model"});
  if (torque) titles.push_back("of torque");
  if (!one) titles.push_back("extended");
  if (!one && torque) titles.push_back("of torque");
  return html_table(titles, rows, {"", "", "n", "n", "n", "n", "n", "n"});
}

}  // namespace diffnea::report
