#include "report/simulated_charts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "report/format.hpp"
#include "report/html.hpp"
#include "report/time_charts.hpp"

namespace diffnea::report {
namespace {

constexpr std::size_t kOpen =
    2;  ///< joints that are drawn open: of causes, or whose error falls most

/// Joints that causes name, in their order, then the others by how much their error falls.
std::vector<std::size_t> by_interest(const Finding& f) {
  const SimulatedMotion& m = f.simulated;
  std::vector<std::size_t> out(m.joints.size());
  std::iota(out.begin(), out.end(), 0);
  std::ranges::stable_sort(out, {}, [&](std::size_t j) {
    const SimulatedSeries& s = m.joints[j];
    return s.base_rmse > 0.0 ? s.extended_rmse / s.base_rmse : 1.0;
  });
  const auto cause_of = [&](std::size_t j) {
    const std::string& joint = m.joints[j].joint;
    return std::ranges::find(f.causes, joint, &Cause::where) - f.causes.begin();
  };
  std::ranges::stable_sort(out, {}, cause_of);
  return out;
}

std::string in_unit(double value, const std::string& of) {
  return of == "m" ? number(1e3 * value, 3) + " mm" : number(1e3 * value, 3) + " mrad";
}

std::string failures(const SimulatedMotion& m) {
  if (m.base_failed + m.extended_failed == 0) return "";
  return " The simulation was tried and blew up in " + std::to_string(m.base_failed) + " of " +
         std::to_string(m.windows) + " windows with the base model, in " +
         std::to_string(m.extended_failed) + " with the extended one; errors are over the others.";
}

}  // namespace

std::vector<TorqueSeries> simulated_series(const SimulatedMotion& m) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  std::vector<TorqueSeries> out;
  for (const SimulatedSeries& s : m.joints) {
    TorqueSeries of;
    of.joint = s.joint;
    of.unit = s.unit;
    double offset = 0.0, step = 0.0;
    for (std::size_t k = 0; k < s.time.size(); ++k) {
      // A window ends where both models have no value and the next row is none of its own.
      const bool begins = k == 0 || (std::isnan(s.base[k - 1]) && std::isnan(s.extended[k - 1]) &&
                                     !std::isnan(s.base[k]));
      if (k + 1 < s.time.size() && !begins) step = s.time[k] - s.time[k - 1];
      if (begins) {
        const double from = of.time.empty() ? 0.0 : of.time.back() + 0.05 * m.window + step;
        if (!of.time.empty()) {
          of.time.push_back(0.5 * (of.time.back() + from));
          for (std::vector<double>* y : {&of.measured, &of.fitted, &of.nominal}) y->push_back(kNaN);
        }
        offset = from - s.time[k];
      }
      of.time.push_back(s.time[k] + offset);
      of.measured.push_back(s.measured[k]);
      of.nominal.push_back(s.base[k]);
      of.fitted.push_back(s.extended[k]);
    }
    out.push_back(std::move(of));
  }
  return out;
}

std::string simulated_gain(const Finding& f) {
  const SimulatedMotion& m = f.simulated;
  if (m.joints.empty() || !m.reason.empty()) return "";
  const SimulatedSeries& s = m.joints[by_interest(f).front()];
  if (!std::isfinite(s.base_rmse)) return "";
  const std::string how = m.driven_by == "controller" ? "Simulated in its control loop"
                                                      : "Simulated from the measured torque";
  const std::string windows = " over windows of " + number(m.window, 2) + " s";
  if (f.causes.empty())
    return how + ", " + s.joint + " misses the measured motion by " + in_unit(s.base_rmse, s.unit) +
           windows + " (rms).";
  return how + ", the motion of " + s.joint + " misses the measured one by " +
         in_unit(s.base_rmse, s.unit) + " before and by " + in_unit(s.extended_rmse, s.unit) +
         " after" + windows + " (rms).";
}

std::string simulated_charts(const Finding& f, const std::vector<TorqueSeries>& drawn,
                             const std::string& set) {
  const SimulatedMotion& m = f.simulated;
  if (m.driven_by.empty() && m.reason.empty()) return "";  // written before there was one
  std::string out = element("h2", "Motion on held-out data, measured and simulated");
  if (!m.reason.empty())
    return out + element("p", "No simulated motion is shown: " + m.reason + ".", "faint");
  const bool one = f.causes.empty();
  const ChartNames names{"base model", one ? "base model" : "extended model", true, one};
  out += element("p",
                 "Each of " + std::to_string(m.windows) + " windows of " + number(m.window, 2) +
                     " s begins in the measured state; then the simulation runs by itself, " +
                     (m.driven_by == "controller"
                          ? "with the recording's controller in the loop (its gains are known)"
                          : "driven by the measured torque alone") +
                     ". The windows are spread over the recording and drawn side by side." +
                     failures(m),
                 "faint");
  const std::vector<std::size_t> order = by_interest(f);
  std::vector<std::size_t> open(order.begin(),
                                order.begin() + static_cast<long>(std::min(kOpen, order.size()))),
      rest(order.begin() + static_cast<long>(open.size()), order.end());
  std::ranges::sort(open);
  std::ranges::sort(rest);
  const bool with_series =
      std::ranges::any_of(drawn, [](const TorqueSeries& s) { return !s.time.empty(); });
  const int columns = chart_columns(2 * drawn.size());
  if (with_series)
    out += "<div " + chart_set(set, names) + ">" + chart_keys(names) +
           time_charts(drawn, open, "position", columns, names) + "</div>\n";
  if (with_series && !rest.empty())
    out += "<details " + chart_set(set, names) + "><summary>The other " +
           (rest.size() == 1 ? "joint" : std::to_string(rest.size()) + " joints") + "</summary>\n" +
           time_charts(drawn, rest, "position", columns, names) + "</details>\n";
  std::vector<std::vector<std::string>> rows;
  for (const SimulatedSeries& s : m.joints) {
    rows.push_back({escape(s.joint), in_unit(s.base_rmse, s.unit)});
    if (!f.causes.empty()) rows.back().push_back("<b>" + in_unit(s.extended_rmse, s.unit) + "</b>");
  }
  std::vector<std::string> titles{"rms position error", "base model"};
  if (!f.causes.empty()) titles.push_back("extended");
  out += html_table(titles, rows, {"", "n", "n"});
  std::string farther;
  for (const Cause& c : f.causes)
    for (const SimulatedSeries& s : m.joints)
      if (s.joint == c.where && s.extended_rmse > s.base_rmse &&
          farther.find(s.joint) == std::string::npos)
        farther += (farther.empty() ? "" : ", ") + s.joint;
  if (!farther.empty())
    out += element("p",
                   "The extended model's torque fits better, but its motion of " + farther +
                       " does not: take its parameters there with care (of a hidden motor, torque "
                       "alone shows a ratio).",
                   "warning");
  return out;
}

}  // namespace diffnea::report
