#include "report/diagnose_sections.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/text.hpp>

#include "report/diagnose_words.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {
namespace {

/// Whether the series file holds what the drawing needs.
bool is_drawn(const GreyBox& g) {
  std::size_t points = 1;
  for (const std::vector<double>& values : g.at) {
    if (values.size() < 2) return false;
    points *= values.size();
  }
  return !g.at.empty() && g.at.size() <= 2 && g.at.size() == g.variables.size() &&
         g.units.size() == g.at.size() && g.torque.size() == points && g.std.size() == points;
}

std::string waterfall(const Finding& f) {
  const Gain& g = f.gain;
  const double first = g.before * g.before, last = g.after * g.after;
  if (!std::isfinite(first) || !std::isfinite(last)) return "";
  std::vector<Bar> list{{"base model", number(g.before, 3) + " × noise", 0.0, first, "base"}};
  double level = first;
  const auto step = [&](const std::string& label, double removed) {
    list.push_back({label, "− " + percent(removed / first), level - removed, level, "removed"});
    level -= removed;
  };
  for (const Cause& c : f.causes)
    step(at(c.effect, c.where), c.gain.before * c.gain.before - c.gain.after * c.gain.after);
  // Effects overlap: what they remove together need not be the sum of what each removes alone.
  if (!f.causes.empty() && std::abs(level - last) > 0.01 * first)
    step("together, beyond each alone", level - last);
  if (!f.causes.empty())
    list.push_back({"extended model", number(g.after, 3) + " × noise", 0.0, last, "after"});
  list.push_back({"noise floor", number(g.noise_floor, 3) + " × noise", 0.0,
                  g.noise_floor * g.noise_floor, "floor"});
  return element("p",
                 "Mean square of the held-out " + error_of(f) +
                     ", each channel in units of its noise; what every cause removes with the "
                     "others in place.",
                 "faint") +
         bars(list);
}

std::string joint_table(const Finding& f) {
  const bool one = f.causes.empty();
  const bool motion = follows_commands(f);
  const bool size = motion || !std::ranges::all_of(f.joints, is_ball);
  std::vector<std::vector<std::string>> rows;
  for (const JointGain& j : f.joints) {
    const bool ball = is_ball(j);
    const double scale = is_of_positions(j) ? 1e3 : 1.0;
    std::vector<std::string> row{escape(j.joint),
                                 is_of_positions(j) ? "m" + j.unit : escape(unit(j.unit))};
    const auto put_share = [&](double x) {
      if (size) row.push_back(ball ? "" : percent(x / j.torque_rms));
    };
    if (size) row.push_back(ball ? "" : number(scale * j.torque_rms, 3));
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
  const std::string share = motion ? "of motion" : "of torque";
  if (size) titles.push_back(motion ? "rms motion" : "rms torque");
  titles.insert(titles.end(), {"noise", "base model"});
  if (size) titles.push_back(share);
  if (!one) titles.push_back("extended");
  if (!one && size) titles.push_back(share);
  return html_table(titles, rows, {"", "", "n", "n", "n", "n", "n", "n"});
}

}  // namespace

ChartNames names_of(const Finding& f) {
  const bool one = f.causes.empty();
  return {"base model", one ? "base model" : "extended model", true, one};
}

std::string grey_box_section(const Finding& f) {
  if (f.grey_box.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  std::string drawings;
  for (std::size_t k = 0; k < f.grey_box.size(); ++k) {
    const GreyBox& g = f.grey_box[k];
    rows.push_back({"<b>" + escape(g.where) + "</b>", escape(detail::join(g.variables, " and ")),
                    escape(unit(g.unit)), number(g.before, 3), "<b>" + number(g.after, 3) + "</b>",
                    number(g.torque_rms, 3), number(g.bound, 3),
                    number(g.effective_parameters, 2) + " of " + std::to_string(g.bumps)});
    if (!is_drawn(g)) continue;
    drawings += "<figure><figcaption>" + escape(g.where) + " <small>learned torque over " +
                escape(detail::join(g.variables, " and ")) + "</small></figcaption>" +
                drawing("greyBox", {{"index", std::to_string(k)}}) + "</figure>\n";
  }
  return element("h2", "What is left, learned without a name") +
         element("p",
                 "A grey box: where no effect explains the error, a smooth torque over what it "
                 "depends on, learned from the fitted recordings and judged on held-out ones. It "
                 "names no cause. The named effects keep their estimates beside it; it ends where "
                 "the data end and never gives more than was seen.",
                 "faint") +
         html_table({"joint", "over", "unit", "held-out error before", "after", "rms of it",
                     "at most", "parameters spent"},
                    rows, {"", "", "", "n", "n", "n", "n", "n"}) +
         (drawings.empty() ? "" : "<div class='evidence'>\n" + drawings + "</div>\n");
}

std::string gain_section(const Finding& f) {
  return element("h2", f.causes.empty() ? capital(error_of(f)) + " on held-out data"
                                        : "What was gained on held-out data") +
         waterfall(f) + joint_table(f);
}

}  // namespace diffnea::report
