#include "report/grey_box_charts.hpp"

#include <algorithm>
#include <cmath>

#include "core/c_numbers.hpp"
#include "report/chart.hpp"
#include "report/format.hpp"
#include "report/html.hpp"
#include "report/svg.hpp"

namespace diffnea::report {
namespace {

std::string axis_title(const GreyBox& g, std::size_t k) {
  return g.variables[k] + (k < g.units.size() ? " [" + unit(g.units[k]) + "]" : "");
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& n : names) out += (out.empty() ? "" : " and ") + n;
  return out;
}

/// Blue below 0, white, orange above: colours that the colour-blind tell apart.
std::string colour(double share) {
  const auto mixed = [&](double full) {
    return static_cast<int>(std::lround(255.0 + std::min(std::abs(share), 1.0) * (full - 255.0)));
  };
  char text[40];
  if (share < 0.0)
    detail::print(text, sizeof text, "rgb(%d,%d,%d)", mixed(0), mixed(114), mixed(178));
  else
    detail::print(text, sizeof text, "rgb(%d,%d,%d)", mixed(213), mixed(94), mixed(0));
  return text;
}

/// One variable: the torque with two standard deviations.
std::string line_of(const GreyBox& g) {
  std::vector<double> low, high;
  for (std::size_t k = 0; k < g.torque.size(); ++k) {
    low.push_back(g.torque[k] - 1.96 * g.std[k]);
    high.push_back(g.torque[k] + 1.96 * g.std[k]);
  }
  return band_chart(g.at[0], {{"fitted", &g.torque, &low, &high}}, axis_title(g, 0),
                    "learned [" + unit(g.unit) + "]", std::nan(""));
}

/// Two variables: a map, its legend at the right.
std::string map_of(const GreyBox& g) {
  constexpr double kLeft = 60.0, kRight = 370.0, kTop = 20.0, kBottom = 240.0, kLegend = 392.0;
  double most = 0.0;
  for (const double t : g.torque) most = std::max(most, std::abs(t));
  if (!(most > 0.0)) most = 1.0;
  const std::vector<double>&x = g.at[0], &y = g.at[1];
  const Range rx{x.front(), x.back()}, ry{y.front(), y.back()};
  const double w = (kRight - kLeft) / static_cast<double>(x.size()),
               h = (kBottom - kTop) / static_cast<double>(y.size());
  // Values stand in the middle of their cells.
  const auto to_x = [&](double v) {
    return kLeft + 0.5 * w + (v - rx.low) / rx.width() * (kRight - kLeft - w);
  };
  const auto to_y = [&](double v) {
    return kBottom - 0.5 * h - (v - ry.low) / ry.width() * (kBottom - kTop - h);
  };
  std::string out = "<svg class='band' viewBox='0 0 470 285' role='img'>";
  const auto cell = [&](double left, double top, double width, double height, double torque) {
    out += "<rect style='fill:" + colour(torque / most) + "' x='" + coordinate(left) + "' y='" +
           coordinate(top) + "' width='" + coordinate(width + 0.3) + "' height='" +
           coordinate(height + 0.3) + "'/>";
  };
  for (std::size_t i = 0; i < x.size(); ++i)
    for (std::size_t k = 0; k < y.size(); ++k)
      cell(to_x(x[i]) - 0.5 * w, to_y(y[k]) - 0.5 * h, w, h, g.torque[i * y.size() + k]);
  for (const double t : ticks(rx, 6))
    out += segment("grid", to_x(t), kBottom, to_x(t), kBottom + 4) +
           text_at(to_x(t), kBottom + 16, "middle", number(t));
  for (const double t : ticks(ry, 5))
    out += segment("grid", kLeft - 4, to_y(t), kLeft, to_y(t)) +
           text_at(kLeft - 6, to_y(t) + 4, "end", number(t));
  constexpr int kSteps = 21;
  const double step = (kBottom - kTop) / kSteps;
  for (int k = 0; k < kSteps; ++k)
    cell(kLegend, kBottom - step * (k + 1), 14.0, step, most * (2.0 * k / (kSteps - 1) - 1.0));
  for (const double v : {-most, 0.0, most})
    out +=
        text_at(kLegend + 19, 0.5 * (kTop + kBottom) - v / most * 0.5 * (kBottom - kTop - step) + 4,
                "start", number(v, 2));
  out += text_at(0.5 * (kLeft + kRight), 278, "middle", axis_title(g, 0)) +
         text_at(4, kTop - 8, "start", axis_title(g, 1)) +
         text_at(kLegend, kTop - 8, "start", unit(g.unit));
  return out + "</svg>\n";
}

/// Whether the series file holds what the drawing needs.
bool is_drawn(const GreyBox& g) {
  std::size_t points = 1;
  for (const std::vector<double>& values : g.at) {
    if (values.size() < 2) return false;
    points *= values.size();
  }
  return !g.at.empty() && g.at.size() <= 2 && g.at.size() == g.variables.size() &&
         g.torque.size() == points && g.std.size() == points;
}

}  // namespace

std::string grey_box_section(const Finding& f) {
  if (f.grey_box.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  std::string drawings;
  for (const GreyBox& g : f.grey_box) {
    rows.push_back({"<b>" + escape(g.where) + "</b>", escape(listed(g.variables)),
                    escape(unit(g.unit)), number(g.before, 3), "<b>" + number(g.after, 3) + "</b>",
                    number(g.torque_rms, 3), number(g.bound, 3),
                    number(g.effective_parameters, 2) + " of " + std::to_string(g.bumps)});
    if (!is_drawn(g)) continue;
    drawings += "<figure><figcaption>" + escape(g.where) + " <small>learned torque over " +
                escape(listed(g.variables)) + "</small></figcaption>" +
                (g.at.size() == 1 ? line_of(g) : map_of(g)) + "</figure>\n";
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

}  // namespace diffnea::report
