#pragma once
/// What all drawings are made of: ranges, round numbers, strokes and texts as SVG.

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace diffnea::report {

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void take(double x) {
    if (!std::isfinite(x)) return;
    low = std::min(low, x);
    high = std::max(high, x);
  }
  bool empty() const { return !(low <= high); }
  double width() const { return high - low; }
  /// With a margin, and never empty.
  Range widened(double share) const;
};

/// Positions of round numbers, about `count` of them: steps of 1, 2 or 5 times a power of ten.
std::vector<double> ticks(const Range& range, int count);

/// One decimal: a tenth of a pixel.
std::string coordinate(double x);
std::string text_at(double x, double y, const char* anchor, const std::string& text);
std::string segment(const char* css_class, double x1, double y1, double x2, double y2);
std::string box(const char* css_class, double x, double y, double width, double height);

/// The strokes of one line, broken where x or y is NaN; of the points in one column of pixels the
/// lowest and the highest are kept.
template <typename X, typename Y>
std::string path(const std::vector<double>& x, const std::vector<double>& y, X to_x, Y to_y,
                 double column_width) {
  std::string out;
  bool drawing = false;
  const auto put = [&](std::size_t k) {
    out += drawing ? "L" : "M";
    out += coordinate(to_x(x[k])) + " " + coordinate(to_y(y[k]));
    drawing = true;
  };
  std::size_t k = 0;
  while (k < x.size()) {
    if (!std::isfinite(y[k]) || !std::isfinite(x[k])) {
      drawing = false;
      ++k;
      continue;
    }
    const double column = std::floor(to_x(x[k]) / column_width);
    if (!std::isfinite(column)) {  // of a range that no number holds
      drawing = false;
      ++k;
      continue;
    }
    std::size_t lowest = k, highest = k;
    for (; k < x.size() && std::isfinite(y[k]) && std::floor(to_x(x[k]) / column_width) == column;
         ++k) {
      if (y[k] < y[lowest]) lowest = k;
      if (y[k] > y[highest]) highest = k;
    }
    put(std::min(lowest, highest));
    if (lowest != highest) put(std::max(lowest, highest));
  }
  return out;
}

}  // namespace diffnea::report
