#pragma once
/// Drawings as inline SVG: what the page prints, and shows where the chart library is missing.

#include <string>
#include <utility>
#include <vector>

namespace diffnea::report {

struct Line {
  const char* css_class;  ///< colour and dash are the style's
  const std::vector<double>* y;
};

/// Lines over time. A NaN breaks a line. Columns of pixels show lowest and highest value, so that a
/// peak is never lost.
/// @param x_range  first and last time that the axis shows
/// @param columns  of pixels that are drawn
std::string line_chart(const std::vector<double>& x, const std::vector<Line>& lines,
                       const std::pair<double, double>& x_range, const std::string& unit,
                       int height, int columns);

/// One parameter: where it was (tick), where it is (dot), two standard errors to either side (bar).
std::string error_bar(double prior, double value, double std);

}  // namespace diffnea::report
