#include "report/chart.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/format.hpp"
#include "report/svg.hpp"

namespace diffnea::report {
namespace {

constexpr double kWidth = 900.0, kLeft = 52.0, kRight = 8.0, kTop = 8.0, kBottom = 24.0;

/// A chart of the page's width: where values lie, its frame and its titles.
struct Axes {
  Range rx, ry;
  int height;

  double bottom() const { return height - kBottom; }
  double x(double v) const {
    return kLeft + (v - rx.low) / (rx.high - rx.low) * (kWidth - kLeft - kRight);
  }
  double y(double v) const {
    return bottom() - (v - ry.low) / (ry.high - ry.low) * (bottom() - kTop);
  }
  /// The element's opening, the grid and the numbers.
  std::string begin() const {
    std::string out =
        "<svg viewBox='0 0 " + coordinate(kWidth) + " " + std::to_string(height) + "' role='img'>";
    for (const double t : ticks(ry, height / 40))
      out += segment("grid", kLeft, y(t), kWidth - kRight, y(t)) +
             text_at(kLeft - 5, y(t) + 4, "end", number(t));
    for (const double t : ticks(rx, 8)) out += text_at(x(t), height - 8, "middle", number(t));
    return out;
  }
  std::string titles(const std::string& below, const std::string& above) const {
    return text_at(kWidth - kRight, bottom() - 4, "end", below) +
           text_at(kLeft + 4, kTop + 8, "start", above);
  }
};

}  // namespace

std::string line_chart(const std::vector<double>& x, const std::vector<Line>& lines,
                       const std::pair<double, double>& x_range, const std::string& unit,
                       int height, int columns, const Backdrop& behind) {
  Range ry;
  for (const Line& line : lines)
    for (const double v : *line.y) ry.take(v);
  ry.take(behind.level);
  ry.take(behind.band);
  ry.take(-behind.band);
  const Range rx = Range{x_range.first, x_range.second}.widened(0.0);
  ry = ry.widened(0.05);
  const Axes at{rx, ry, height};
  std::string out = at.begin();
  for (const auto& [from, to] : behind.spans)
    out += box("span", at.x(from), kTop, std::max(at.x(to) - at.x(from), 0.5), at.bottom() - kTop);
  if (std::isfinite(behind.band))
    out += box("noise", kLeft, at.y(behind.band), kWidth - kLeft - kRight,
               at.y(-behind.band) - at.y(behind.band));
  if (std::isfinite(behind.level))
    out += segment("level", kLeft, at.y(behind.level), kWidth - kRight, at.y(behind.level));
  for (const double x_flag : behind.flags)
    out += segment("flag", at.x(x_flag), kTop, at.x(x_flag), kTop + 7);
  out += at.titles("s", unit);
  for (const Line& line : lines)
    out += std::string("<path class='") + line.css_class + "' d='" +
           path(
               x, *line.y, [&](double v) { return at.x(v); }, [&](double v) { return at.y(v); },
               (kWidth - kLeft) / columns) +
           "'/>";
  return out + "</svg>\n";
}

std::vector<Bin> binned(const std::vector<double>& x, const std::vector<double>& y, int bins) {
  std::vector<double> sorted;
  for (std::size_t k = 0; k < x.size(); ++k)
    if (std::isfinite(x[k]) && std::isfinite(y[k])) sorted.push_back(x[k]);
  std::ranges::sort(sorted);
  const std::size_t per_bin =
      std::max<std::size_t>(sorted.size() / static_cast<std::size_t>(bins), 1);
  std::vector<double> upper;  // the last value of each bin
  for (std::size_t k = per_bin; k <= sorted.size() && upper.size() < static_cast<std::size_t>(bins);
       k += per_bin)
    if (upper.empty() || sorted[k - 1] > upper.back()) upper.push_back(sorted[k - 1]);
  if (upper.empty()) return {};
  upper.back() = sorted.back();
  const auto bin_of = [&](double v) { return std::ranges::lower_bound(upper, v) - upper.begin(); };

  std::vector<Bin> out(upper.size());
  std::vector<double> count(upper.size(), 0.0);
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (!std::isfinite(x[k]) || !std::isfinite(y[k])) continue;
    const auto b = static_cast<std::size_t>(bin_of(x[k]));
    out[b].x += x[k];
    out[b].mean += y[k];
    count[b] += 1.0;
  }
  for (std::size_t b = 0; b < out.size(); ++b) {
    out[b].x /= count[b];
    out[b].mean /= count[b];
  }
  std::vector<double> squares(upper.size(), 0.0), stays(upper.size(), 0.0);
  for (std::size_t k = 0; k < x.size();) {
    if (!std::isfinite(x[k]) || !std::isfinite(y[k])) {
      ++k;
      continue;
    }
    const auto b = static_cast<std::size_t>(bin_of(x[k]));
    double sum = 0.0;
    for (; k < x.size() && std::isfinite(x[k]) && std::isfinite(y[k]) &&
           static_cast<std::size_t>(bin_of(x[k])) == b;
         ++k)
      sum += y[k] - out[b].mean;
    squares[b] += sum * sum;
    stays[b] += 1.0;
  }
  for (std::size_t b = 0; b < out.size(); ++b)
    out[b].half = stays[b] < 2.0
                      ? std::numeric_limits<double>::quiet_NaN()
                      : 1.96 * std::sqrt(squares[b] * stays[b] / (stays[b] - 1.0)) / count[b];
  return out;
}

std::string binned_chart(const std::vector<Bin>& bins, const std::string& x_unit,
                         const std::string& y_unit, int height) {
  Range rx, ry;
  ry.take(0.0);
  for (const Bin& b : bins) {
    rx.take(b.x);
    ry.take(b.mean);
    ry.take(b.mean - b.half);
    ry.take(b.mean + b.half);
  }
  rx = rx.widened(0.02);
  ry = ry.widened(0.05);
  const Axes at{rx, ry, height};
  std::string out = at.begin();
  out += segment("prior", kLeft, at.y(0.0), kWidth - kRight, at.y(0.0));
  for (const Bin& b : bins) {
    if (std::isfinite(b.half))
      out += segment("spread", at.x(b.x), at.y(b.mean - b.half), at.x(b.x), at.y(b.mean + b.half));
    out +=
        "<circle cx='" + coordinate(at.x(b.x)) + "' cy='" + coordinate(at.y(b.mean)) + "' r='3'/>";
  }
  return out + at.titles(x_unit, y_unit) + "</svg>\n";
}

std::string band_chart(const std::vector<double>& x, const std::vector<Band>& bands,
                       const std::string& x_title, const std::string& y_title, double mark) {
  constexpr double kWide = 450.0, kHigh = 230.0, kLow = kHigh - 38.0, kAbove = 20.0;
  Range rx, ry;
  for (const double v : x) rx.take(v);
  for (const Band& b : bands)
    for (const auto* y : {b.mean, b.low, b.high})
      for (const double v : *y) ry.take(v);
  ry.take(0.0);
  rx = rx.widened(0.02);
  ry = ry.widened(0.06);
  const auto to_x = [&](double v) {
    return kLeft + (v - rx.low) / (rx.high - rx.low) * (kWide - kLeft - kRight);
  };
  const auto to_y = [&](double v) {
    return kLow - (v - ry.low) / (ry.high - ry.low) * (kLow - kAbove);
  };
  std::string out = "<svg class='band' viewBox='0 0 " + coordinate(kWide) + " " +
                    coordinate(kHigh) + "' role='img'>";
  for (const double t : ticks(ry, 5))
    out += segment("grid", kLeft, to_y(t), kWide - kRight, to_y(t)) +
           text_at(kLeft - 5, to_y(t) + 4, "end", number(t));
  for (const double t : ticks(rx, 6))
    out += segment("grid", to_x(t), kLow, to_x(t), kLow + 4) +
           text_at(to_x(t), kLow + 16, "middle", number(t));
  out += segment("zero", kLeft, to_y(0), kWide - kRight, to_y(0));
  if (std::isfinite(mark) && mark > rx.low && mark < rx.high)
    out += segment("mark", to_x(mark), kAbove, to_x(mark), kLow);
  out += text_at((kLeft + kWide) / 2, kHigh - 4, "middle", x_title) +
         text_at(4, kAbove - 8, "start", y_title);
  for (const Band& b : bands) {  // runs of finite intervals
    for (std::size_t k = 0; k < x.size();) {
      std::size_t end = k;
      while (end < x.size() && std::isfinite((*b.low)[end]) && std::isfinite((*b.high)[end])) ++end;
      if (end > k + 1) {
        std::string points;
        for (std::size_t i = k; i < end; ++i)
          points += coordinate(to_x(x[i])) + "," + coordinate(to_y((*b.high)[i])) + " ";
        for (std::size_t i = end; i-- > k;)
          points += coordinate(to_x(x[i])) + "," + coordinate(to_y((*b.low)[i])) + " ";
        out += std::string("<polygon class='") + b.css_class + "' points='" + points + "'/>";
      }
      k = std::max(end, k) + 1;
    }
  }
  for (const Band& b : bands)
    out += std::string("<path class='") + b.css_class + "' d='" +
           path(x, *b.mean, to_x, to_y, 1e-3) + "'/>";
  return out + "</svg>\n";
}

std::string bar_chart(const std::vector<Bar>& bars, bool logarithmic, double knee) {
  constexpr double kRow = 22.0, kLabels = 300.0, kTexts = 170.0;
  const auto scaled = [&](double v) { return logarithmic ? std::asinh(v / knee) : v; };
  Range range;
  range.take(0.0);
  for (const Bar& b : bars) {
    range.take(scaled(b.begin));
    range.take(scaled(b.end));
  }
  if (logarithmic) range.take(scaled(2.0 * knee));
  if (!(range.high > range.low)) range.high = range.low + 1.0;
  const auto to_x = [&](double v) {
    return kLabels +
           (scaled(v) - range.low) / (range.high - range.low) * (kWidth - kLabels - kTexts);
  };
  const double height = kRow * static_cast<double>(bars.size()) + 4.0;
  std::string out = "<svg class='bars' viewBox='0 0 " + coordinate(kWidth) + " " +
                    coordinate(height) + "' role='img'>" +
                    segment("zero", to_x(0), 0, to_x(0), height);
  if (logarithmic) out += segment("mark", to_x(knee), 0, to_x(knee), height);
  double y = 4.0;
  for (const Bar& b : bars) {
    if (std::isfinite(b.begin) && std::isfinite(b.end)) {
      const double left = std::min(to_x(b.begin), to_x(b.end));
      const double wide = std::abs(to_x(b.end) - to_x(b.begin));
      out += std::string("<rect class='") + b.css_class + "' x='" + coordinate(left) + "' y='" +
             coordinate(y) + "' width='" + coordinate(std::max(wide, 0.5)) + "' height='14'/>";
      out += text_at(std::max(left + wide, to_x(0)) + 6, y + 11, "start", b.text);
    }
    out += text_at(kLabels - 8, y + 11, "end", b.label);
    y += kRow;
  }
  return out + "</svg>\n";
}

std::string error_bar(double prior, double value, double std) {
  const double spread = std::isfinite(std) ? 2.0 * std : 0.0;
  Range range;
  range.take(value - spread);
  range.take(value + spread);
  range.take(prior);
  range = range.widened(0.1);
  const auto to_x = [&](double v) {
    return 4.0 + 172.0 * (v - range.low) / (range.high - range.low);
  };
  std::string out = "<svg class='bar' viewBox='0 0 180 14'>";
  if (range.low < 0.0 && range.high > 0.0) out += segment("grid", to_x(0), 0, to_x(0), 14);
  out += segment("prior", to_x(prior), 1, to_x(prior), 13);
  if (spread > 0.0) out += segment("spread", to_x(value - spread), 7, to_x(value + spread), 7);
  return out + "<circle cx='" + coordinate(to_x(value)) + "' cy='7' r='3'/></svg>";
}

}  // namespace diffnea::report
