#include "report/ball_charts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/c_numbers.hpp"
#include "report/ball_views.hpp"
#include "report/chart.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {
namespace {

using Point = BallSeries::Point;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostRows = 2000;  ///< of each chart that zooms
constexpr int kColumns = 420;            ///< of pixels in a drawing
constexpr std::size_t kMostFlags = 20;   ///< that the page lists
/// Between runs [s]: twice what parts windows (BallFitOptions::longest_gap), so that it shows as a
/// pause, and a third of a short flight. A share of the axis would grow with every run.
constexpr double kBetweenRuns = 0.2;

std::string mm(double metres) { return number(1e3 * metres, 3) + " mm"; }

double distance(const Point& a, const Point& b) {
  return std::sqrt(std::pow(a[0] - b[0], 2) + std::pow(a[1] - b[1], 2) + std::pow(a[2] - b[2], 2));
}

bool any_finite(const std::vector<Point>& points) {
  return std::ranges::any_of(points, [](const Point& p) { return std::isfinite(p[0]); });
}

/// All rows on one axis: runs one after the other, a gap before each window.
class OneAxis {
 public:
  explicit OneAxis(const BallSeries& b) {
    double last = kNaN;
    for (const auto& [from, to] : windows_of(b)) {
      const int run = b.run[from];
      if (!offset_.contains(run))
        offset_[run] = time.empty() ? 0.0 : last + kBetweenRuns - b.time[from];
      if (!time.empty()) {
        time.push_back(0.5 * (last + b.time[from] + offset_[run]));
        row.push_back(kGap);
      }
      for (std::size_t k = from; k < to; ++k) {
        time.push_back(b.time[k] + offset_[run]);
        row.push_back(k);
      }
      last = time.back();
    }
  }
  static constexpr std::size_t kGap = std::numeric_limits<std::size_t>::max();
  std::vector<double> time;      ///< [s]
  std::vector<std::size_t> row;  ///< of the series, or kGap

  std::pair<double, double> range() const { return {time.front(), time.back()}; }
  /// NaN in a run that has no rows.
  double at(int run, double t) const {
    const auto it = offset_.find(run);
    return it == offset_.end() ? kNaN : t + it->second;
  }
  /// At most so many rows, evenly, and the gaps among them unless they are half of it.
  std::vector<std::size_t> thinned(std::size_t most) const {
    const auto count = static_cast<std::size_t>(std::ranges::count(row, kGap));
    const bool gaps = count < most / 2;
    const std::size_t may = most - (gaps ? count : 0), stride = (time.size() + may - 1) / may;
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < row.size(); ++i)
      if (i % stride == 0 || (gaps && row[i] == kGap)) out.push_back(i);
    return out;
  }
  /// value(k) of each row, NaN at the gaps.
  template <class F>
  std::vector<double> column(const F& value) const {
    std::vector<double> out(row.size(), kNaN);
    for (std::size_t i = 0; i < row.size(); ++i)
      if (row[i] != kGap) out[i] = value(row[i]);
    return out;
  }

 private:
  std::map<int, double> offset_;
};

/// Stretches at which the string is taut. Those that a chart cannot show apart are one.
std::vector<std::pair<double, double>> taut_spans(const BallSeries& b, const OneAxis& axis) {
  std::vector<std::pair<double, double>> out;
  const double least = 1e-3 * (axis.time.back() - axis.time.front());
  bool inside = false;
  for (std::size_t i = 0; i < axis.row.size(); ++i) {
    const bool taut = axis.row[i] != OneAxis::kGap && b.taut[axis.row[i]];
    if (!taut) {
      inside = false;
      continue;
    }
    const double t = axis.time[i];
    if (!inside && (out.empty() || t - out.back().second > least)) out.emplace_back(t, t);
    out.back().second = t;
    inside = true;
  }
  return out;
}

std::vector<double> flag_times(const BallSeries& b, const OneAxis& axis) {
  std::vector<double> out;
  for (const BallFlag& f : b.flagged) {
    const double t = axis.at(f.run, f.time);
    if (t >= axis.time.front() && t <= axis.time.back()) out.push_back(t);
  }
  return out;
}

// --- what charts that zoom are made of

std::string json(const std::vector<double>& values, const std::vector<std::size_t>& shown,
                 int digits) {
  std::string out = "[";
  char text[32];
  for (const std::size_t k : shown) {
    detail::print(text, sizeof text, "%.*g", digits, values[k]);
    out += (out.size() > 1 ? "," : "") +
           (std::isfinite(values[k]) ? std::string(text) : std::string("null"));
  }
  return out + "]";
}

/// One chart: what it shows, and what stands behind it.
struct BallChart {
  std::vector<double> time;
  std::vector<double> measured, base, extended;    ///< [m]; of an error alone: empty
  std::vector<double> base_error, extended_error;  ///< measured − model [mm]
  Backdrop behind, behind_error;
};

std::string json(const BallChart& c, const std::vector<std::size_t>& shown) {
  std::string spans, flags;
  for (const auto& [from, to] : c.behind.spans)
    spans += (spans.empty() ? "" : ",") + ("[" + number(from, 7) + "," + number(to, 7) + "]");
  for (const double t : c.behind.flags) flags += (flags.empty() ? "" : ",") + number(t, 7);
  std::string out = "{\"time\":" + json(c.time, shown, 7);
  if (!c.measured.empty())
    out += ",\"measured\":" + json(c.measured, shown, 5) +
           ",\"nominal\":" + json(c.base, shown, 5) + ",\"fitted\":" + json(c.extended, shown, 5);
  out += ",\"error\":{\"before\":" + json(c.base_error, shown, 4) +
         ",\"after\":" + json(c.extended_error, shown, 4) + "}";
  out += ",\"spans\":[" + spans + "],\"flags\":[" + flags + "]";
  if (std::isfinite(c.behind.level)) out += ",\"level\":" + number(c.behind.level, 6);
  if (std::isfinite(c.behind_error.band)) out += ",\"band\":" + number(c.behind_error.band, 4);
  return out + "}";
}

BallChart length_chart(const BallSeries& b, const OneAxis& axis) {
  BallChart c;
  c.time = axis.time;
  const auto to = [&](const std::vector<Point>& points) {
    return axis.column([&](std::size_t k) { return distance(points[k], b.anchor[k]); });
  };
  c.measured = to(b.measured);
  c.base = to(b.base);
  c.extended = to(b.extended);
  const auto error = [&](const std::vector<double>& model) {
    std::vector<double> out(model.size(), kNaN);
    for (std::size_t i = 0; i < model.size(); ++i)
      if (axis.row[i] != OneAxis::kGap && b.taut[axis.row[i]])
        out[i] = 1e3 * (c.measured[i] - model[i]);
    return out;
  };
  c.base_error = error(c.base);
  c.extended_error = error(c.extended);
  c.behind.spans = taut_spans(b, axis);
  c.behind.level = b.length;
  c.behind.flags = flag_times(b, axis);
  c.behind_error = {{}, 2e3 * b.sigma, kNaN, c.behind.flags};
  return c;
}

BallChart error_chart(const BallSeries& b, const OneAxis& axis, std::size_t along) {
  BallChart c;
  c.time = axis.time;
  const auto error = [&](const std::vector<Point>& model) {
    return axis.column(
        [&](std::size_t k) { return 1e3 * (b.measured[k][along] - model[k][along]); });
  };
  c.base_error = error(b.base);
  c.extended_error = error(b.extended);
  c.behind.flags = flag_times(b, axis);
  c.behind_error = {{}, 2e3 * b.sigma, kNaN, c.behind.flags};
  return c;
}

// --- parts of the section

std::string error_holder(const BallChart& c, const ChartNames& names, const OneAxis& axis,
                         const std::string& index, const char* title) {
  std::vector<Line> lines;
  if (!names.one_model) lines.push_back({"nominal", &c.base_error});
  lines.push_back({"fitted", &c.extended_error});
  return "<div class='chart residual' data-joint='" + index + "'>" +
         line_chart(c.time, lines, axis.range(), title, 110, kColumns, c.behind_error) + "</div>\n";
}

std::string length_part(const BallSeries& b, const ChartNames& names, const OneAxis& axis,
                        const BallChart& c) {
  std::vector<Line> lines{{"measured", &c.measured}};
  if (!names.one_model) lines.push_back({"nominal", &c.base});
  lines.push_back({"fitted", &c.extended});
  return "<section class='joint'>" + element("h3", "Length of the string") +
         "<p class='faint'>Distance of the ball from where the string is tied [m]; dashed: the "
         "string's length, " +
         number(b.length, 4) + " m<span class='key span'></span>taut there" +
         (b.flagged.empty() ? "" : "<span class='key flag'></span>flagged") +
         ". Below, while it is taut: by how much the ball is farther away than the model has it "
         "[mm]<span class='key noise'></span>± 2 σ of the noise.</p>\n"
         "<div class='chart torque' data-joint='0'>" +
         line_chart(c.time, lines, axis.range(), "m", 210, kColumns, c.behind) + "</div>\n" +
         error_holder(c, names, axis, "0", "measured − model mm") + "</section>\n";
}

std::string error_part(const std::vector<BallChart>& charts, const ChartNames& names,
                       const OneAxis& axis, int first) {
  std::string out = "<section class='joint'>" + element("h3", "Error of the position") +
                    "<p class='faint'>Measured − model along the axes of the world [mm]<span "
                    "class='key noise'></span>± 2 σ of the noise.</p>\n";
  constexpr const char* kNames[] = {"x", "y", "z"};
  for (std::size_t c = 0; c < 3; ++c)
    out += element("h4", kNames[c]) +
           error_holder(charts[static_cast<std::size_t>(first) + c], names, axis,
                        std::to_string(first + static_cast<int>(c)), "mm");
  return out + "</section>\n";
}

std::string space_part(const BallSeries& b, const ShownPath& shown, const ChartNames& names,
                       bool with_base) {
  std::string which = shown.rows.size() == shown.windows
                          ? "all " + std::to_string(shown.windows) + " windows"
                          : std::to_string(shown.rows.size()) + " of " +
                                std::to_string(shown.windows) + " windows, spread over the series";
  if (shown.windows == 1) which = "one window";
  return element("h3", "Path in space") +
         "<p class='faint'><span class='key measured'></span>ball, measured<span class='key "
         "fitted'></span>" +
         escape(names.after) +
         (with_base ? "<span class='key nominal'></span>" + escape(names.before) : "") +
         (b.has_string ? "<span class='key anchor'></span>where the string is tied" : "") + "; " +
         which + "<span class='turns-hint'>; drag the last picture to turn it</span></p>\n" +
         projections(b, shown, with_base) + "<div class='turns'></div>\n";
}

std::string summary_table(const BallSeries& b, const ChartNames& names, std::size_t windows) {
  std::vector<std::string> titles{"rms error of one position, along one axis"}, row{"ball"};
  const char* css = "n";
  std::vector<const char*> classes{"", css, css, css, css, css, css};
  if (!names.one_model) {
    titles.push_back(names.before);
    row.push_back(mm(b.base_rms));
  }
  titles.insert(titles.end(), {names.after, "noise σ", "rows", "windows", "flagged"});
  row.insert(row.end(), {"<b>" + mm(b.extended_rms) + "</b>", mm(b.sigma), std::to_string(b.rows()),
                         std::to_string(windows), std::to_string(b.flagged.size())});
  return html_table(titles, {row}, classes);
}

std::string flagged_table(const BallSeries& b) {
  if (b.flagged.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const BallFlag& f : b.flagged) {
    if (rows.size() >= kMostFlags) break;
    rows.push_back({std::to_string(f.run), number(f.time, 6), escape(f.channel), escape(f.reason)});
  }
  const std::size_t more = b.flagged.size() - rows.size();
  return "<details" + std::string(b.flagged.size() <= 5 ? " open" : "") + "><summary>" +
         (b.flagged.size() == 1 ? std::string("One row or flight was")
                                : std::to_string(b.flagged.size()) + " rows or flights were") +
         " flagged: what cannot be true if the model is</summary>\n" +
         html_table({"run", "time [s]", "channel", "why"}, rows, {"n", "n", "", "wrap"}) +
         (more > 0 ? element("p", "and " + std::to_string(more) + " more", "faint") : "") +
         "</details>\n";
}

}  // namespace

std::string ball_section(const BallSeries& b, const ChartNames& named) {
  ChartNames names = named;
  names.both_errors = true;
  const bool with_base = !names.one_model && any_finite(b.base);
  names.one_model = !with_base;
  std::string out =
      element("h2", std::string("The ball ") +
                        (b.held_out ? "on held-out data" : "on the data that were fitted") +
                        ", measured and simulated");
  if (b.time.empty())
    return out + element("p", "The ball was never seen for long enough to be shown.", "faint") +
           flagged_table(b);
  const ShownPath shown = shown_path(b);
  const OneAxis axis(b);
  out += element("p",
                 "Each window begins in a state of its own, estimated from it; then the ball flies "
                 "by itself" +
                     std::string(b.has_string ? ", drawn by its string" : "") + ".",
                 "faint");
  out += summary_table(b, names, shown.windows) + space_part(b, shown, names, with_base);
  std::vector<BallChart> charts;
  std::string over_time;
  if (b.has_string) {
    charts.push_back(length_chart(b, axis));
    over_time = length_part(b, names, axis, charts.front());
    const std::string map = sphere(b, names.before, names.after, with_base);
    if (!map.empty())
      over_time +=
          element("h3", "Error over the direction of the string") +
          "<p class='faint'>Seen from above: straight down in the middle, circles are angles from "
          "it, areas are those of the sphere. Arrows where they are more than noise. What points "
          "one "
          "way everywhere is an offset; what is farther everywhere, a length.</p>\n" +
          map;
  }
  const int first = static_cast<int>(charts.size());
  for (std::size_t c = 0; c < 3; ++c) charts.push_back(error_chart(b, axis, c));
  over_time += error_part(charts, names, axis, first) + flagged_table(b);
  out += "<div " + chart_set("ball", names) + ">" + over_time + "</div>\n";

  std::string data = "{\"space\":" + space_json(b, shown, with_base) + ",\"charts\":[";
  for (std::size_t c = 0; c < charts.size(); ++c)
    data += (c ? "," : "") + json(charts[c], axis.thinned(kMostRows));
  return out + "<script type='application/json' id='ball'>" + script_json(data + "]}") +
         "</script>\n";
}

std::string ball_sentence(const BallSeries& b, bool one_model) {
  if (!std::isfinite(b.extended_rms)) return "";
  const std::string noise =
      b.sigma > 0.0 ? "; the camera's noise is " + mm(b.sigma) : std::string();
  if (one_model || !std::isfinite(b.base_rms))
    return "the ball is simulated " + mm(b.extended_rms) +
           " from where the camera saw it (rms along one axis" + noise + ")";
  return "the ball is simulated " + mm(b.base_rms) + " from where the camera saw it before and " +
         mm(b.extended_rms) + " after (rms along one axis" + noise + ")";
}

std::vector<std::string> flagged_lines(const BallSeries& b, std::size_t most) {
  std::vector<std::string> out;
  for (const BallFlag& f : b.flagged) {
    if (out.size() == most) {
      out.push_back("and " + std::to_string(b.flagged.size() - most) + " more");
      break;
    }
    out.push_back("run " + std::to_string(f.run) + ", " + number(f.time, 5) + " s, " + f.channel +
                  ": " + f.reason);
  }
  return out;
}

}  // namespace diffnea::report
