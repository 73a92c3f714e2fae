#include "report/ball_section.hpp"

#include <algorithm>
#include <cmath>

#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {
namespace {

using Point = BallSeries::Point;

constexpr std::size_t kMostFlags = 20;       ///< that the page lists
constexpr std::size_t kMostPathWindows = 4;  ///< more are a tangle

std::string mm(double metres) { return number(1e3 * metres, 3) + " mm"; }

bool finite(const Point& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

std::size_t count_windows(const BallSeries& b) {
  std::size_t out = 0;
  for (std::size_t k = 0; k < b.time.size(); ++k)
    if (k == 0 || b.window[k] != b.window[k - 1] || b.run[k] != b.run[k - 1]) ++out;
  return out;
}

/// True if some row shows in which direction the string points.
bool knows_direction(const BallSeries& b) {
  for (std::size_t k = 0; k < b.time.size(); ++k)
    if (finite(b.measured[k]) && finite(b.anchor[k]) && finite(b.extended[k]) &&
        b.measured[k] != b.anchor[k])
      return true;
  return false;
}

std::string length_part(const BallSeries& b, const ChartNames& names) {
  return "<section class='joint'>" + element("h3", "Length of the string") +
         "<p class='faint'>Distance of the ball from where the string is tied [m]; dashed: the "
         "string's length, " +
         number(b.length, 4) + " m<span class='key span'></span>taut there" +
         (b.flagged.empty() ? "" : "<span class='key flag'></span>flagged") +
         ". Below, while it is taut: by how much the ball is farther away than the model has it "
         "[mm]<span class='key noise'></span>± 2 σ of the noise.</p>\n" +
         time_chart("ball", "length", "value", names) +
         time_chart("ball", "length", "error", names) + "</section>\n";
}

std::string direction_part(const ChartNames& names) {
  Data data{{"before", names.before}, {"after", names.after}};
  if (names.one_model) data.emplace_back("one", "");
  return element("h3", "Error over the direction of the string") +
         "<p class='faint'>Seen from above: straight down in the middle, circles are angles from "
         "it, areas are those of the sphere. Arrows where they are more than noise. What points "
         "one way everywhere is an offset; what is farther everywhere, a length.</p>\n" +
         drawing("sphere", data) + "\n";
}

std::string error_part(const ChartNames& names) {
  std::string out = "<section class='joint'>" + element("h3", "Error of the position") +
                    "<p class='faint'>Measured − model along the axes of the world [mm]<span "
                    "class='key noise'></span>± 2 σ of the noise.</p>\n";
  for (const char* axis : {"x", "y", "z"})
    out += element("h4", axis) + time_chart("ball", axis, "error", names);
  return out + "</section>\n";
}

std::string space_part(const BallSeries& b, std::size_t windows, const ChartNames& names) {
  std::string which = windows > kMostPathWindows
                          ? std::to_string(kMostPathWindows) + " of " + std::to_string(windows) +
                                " windows, spread over the series"
                      : windows == 1 ? "one window"
                                     : "all " + std::to_string(windows) + " windows";
  Data data{{"windows", std::to_string(kMostPathWindows)}};
  if (names.one_model) data.emplace_back("one", "");
  return element("h3", "Path in space") +
         "<p class='faint'><span class='key measured'></span>ball, measured<span class='key "
         "fitted'></span>" +
         escape(names.after) +
         (names.one_model ? "" : "<span class='key nominal'></span>" + escape(names.before)) +
         (b.has_string ? "<span class='key anchor'></span>where the string is tied" : "") + "; " +
         which + "<span class='turns-hint'>; drag the last picture to turn it</span></p>\n" +
         drawing("space", data) + "\n" + drawing("turns", data, "turns") + "\n";
}

std::string summary_table(const BallSeries& b, const ChartNames& names, std::size_t windows) {
  std::vector<std::string> titles{"rms error of one position, along one axis"}, row{"ball"};
  if (!names.one_model) {
    titles.push_back(names.before);
    row.push_back(mm(b.base_rms));
  }
  titles.insert(titles.end(), {names.after, "noise σ", "rows", "windows", "flagged"});
  row.insert(row.end(), {"<b>" + mm(b.extended_rms) + "</b>", mm(b.sigma), std::to_string(b.rows()),
                         std::to_string(windows), std::to_string(b.flagged.size())});
  return html_table(titles, {row}, {"", "n", "n", "n", "n", "n", "n"});
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
  names.one_model = named.one_model || std::ranges::none_of(b.base, finite);
  std::string out =
      element("h2", std::string("The ball ") +
                        (b.held_out ? "on held-out data" : "on the data that were fitted") +
                        ", measured and simulated");
  if (b.time.empty())
    return out + element("p", "The ball was never seen for long enough to be shown.", "faint") +
           flagged_table(b);
  const std::size_t windows = count_windows(b);
  out += element("p",
                 "Each window begins in a state of its own, estimated from it; then the ball flies "
                 "by itself" +
                     std::string(b.has_string ? ", drawn by its string" : "") + ".",
                 "faint") +
         summary_table(b, names, windows) + space_part(b, windows, names);
  if (b.has_string) out += length_part(b, names);
  if (b.has_string && knows_direction(b)) out += direction_part(names);
  return out + error_part(names) + flagged_table(b);
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
