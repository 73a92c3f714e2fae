#include "report/time_charts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/chart.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {
namespace {

/// Columns of pixels in all drawings together: each some 25 characters in up to 3 lines, below 1
/// MB.
constexpr std::size_t kMaxColumns = 14'000;

/// The shortest step in time, which is that of the decimated grid.
double period(const std::vector<double>& time) {
  double out = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < time.size(); ++k)
    if (time[k] > time[k - 1]) out = std::min(out, time[k] - time[k - 1]);
  return out;
}

/// Every `stride`-th point, runs one after the other on one axis; a gap between them and where rows
/// are missing.
TorqueSeries on_one_axis(const TorqueSeries& in, std::size_t stride) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const double longest = 1.5 * static_cast<double>(stride) * period(in.time);
  TorqueSeries out;
  out.joint = in.joint;
  out.unit = in.unit;
  double offset = 0.0;
  for (std::size_t k = 0; k < in.time.size(); k += stride) {
    double t = in.time[k] + offset;
    const bool next_run = !out.time.empty() && t <= out.time.back();
    if (next_run) {
      offset += out.time.back() + 0.04 * (out.time.back() - out.time.front()) - t;
      t = in.time[k] + offset;
    }
    if (next_run || (!out.time.empty() && t - out.time.back() > longest)) {
      out.time.push_back(0.5 * (out.time.back() + t));
      for (std::vector<double>* y : {&out.measured, &out.fitted, &out.nominal}) y->push_back(kNaN);
    }
    out.time.push_back(t);
    out.measured.push_back(in.measured[k]);
    out.fitted.push_back(in.fitted[k]);
    out.nominal.push_back(in.nominal[k]);
  }
  return out;
}

std::vector<double> difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> out(a.size());
  std::ranges::transform(a, b, out.begin(), std::minus<>());
  return out;
}

}  // namespace

std::vector<TorqueSeries> on_one_axis(const std::vector<TorqueSeries>& in, std::size_t budget) {
  std::size_t points = 0;
  for (const TorqueSeries& s : in) points += s.time.size();
  const std::size_t stride = std::max<std::size_t>(1, (points + budget - 1) / budget);
  std::vector<TorqueSeries> out;
  for (const TorqueSeries& s : in) out.push_back(on_one_axis(s, stride));
  return out;
}

int chart_columns(std::size_t num_series) {
  return static_cast<int>(
      std::clamp<std::size_t>(kMaxColumns / std::max<std::size_t>(2 * num_series, 1), 120, 800));
}

std::string chart_set(const std::string& set, const ChartNames& names) {
  return "data-set='" + set + "' data-before='" + escape(names.before) + "' data-after='" +
         escape(names.after) + "'" + (names.both_errors ? " data-both='1'" : "") +
         (names.one_model ? " data-one='1'" : "");
}

std::string chart_keys(const ChartNames& names) {
  return "<p class='faint'><span class='key measured'></span>measured"
         "<span class='key fitted'></span>" +
         escape(names.after) +
         (names.one_model ? "" : "<span class='key nominal'></span>" + escape(names.before)) +
         "; samples that were left out are gaps"
         "<span class='screen'>; drag to zoom, double-click to see all</span></p>\n";
}

std::string time_charts(const std::vector<TorqueSeries>& all, const std::vector<std::size_t>& which,
                        const std::string& what, int columns, const ChartNames& names) {
  std::string out;
  double first = std::numeric_limits<double>::infinity(), last = -first;
  for (const TorqueSeries& s : all) {
    if (s.time.empty()) continue;
    first = std::min(first, s.time.front());
    last = std::max(last, s.time.back());
  }
  for (const std::size_t j : which) {
    const TorqueSeries& s = all[j];
    const std::string index = std::to_string(j), u = unit(s.unit);
    if (s.time.empty()) {
      out += "<h3>" + escape(s.joint) + " <small>not measured</small></h3>\n";
      continue;
    }
    // What the models lack, where that is the question; else what the fit has too much.
    const bool both = names.both_errors;
    const std::vector<double> before = difference(s.measured, s.nominal),
                              after = both ? difference(s.measured, s.fitted)
                                           : difference(s.fitted, s.measured);
    std::vector<Line> errors;
    std::vector<Line> lines{{"measured", &s.measured}, {"fitted", &s.fitted}};
    if (!names.one_model) {
      if (both) errors.push_back({"nominal", &before});
      lines.insert(lines.begin() + 1, {"nominal", &s.nominal});
    }
    errors.push_back({"fitted", &after});
    out += "<section class='joint'><h3>" + escape(s.joint) + " <small>" + what +
           (names.one_model ? ", and what the model lacks below ["
            : both          ? ", and what both models lack below ["
                            : ", and the fit's error below [") +
           escape(u) + "]</small></h3>\n<div class='chart torque' data-joint='" + index + "'>" +
           line_chart(s.time, lines, {first, last}, u, 210, columns) +
           "</div>\n<div class='chart residual' data-joint='" + index + "'>" +
           line_chart(s.time, errors, {first, last}, (both ? "measured − model " : "error ") + u,
                      110, columns) +
           "</div></section>\n";
  }
  return out;
}

}  // namespace diffnea::report
