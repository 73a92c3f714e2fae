#pragma once
/// Drawings as inline SVG: what the page prints, and shows where the chart library is missing.

#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace diffnea::report {

struct Line {
  const char* css_class;  ///< colour and dash are the style's
  const std::vector<double>* y;
};

/// What stands behind lines over time. NaN: none.
struct Backdrop {
  std::vector<std::pair<double, double>> spans;             ///< of time, shaded
  double band = std::numeric_limits<double>::quiet_NaN();   ///< from −band to band, shaded
  double level = std::numeric_limits<double>::quiet_NaN();  ///< a dashed line
  std::vector<double> flags;                                ///< times with a tick at the top
};

/// Lines over time. A NaN breaks a line. Columns of pixels show lowest and highest value, so that a
/// peak is never lost.
/// @param x_range  first and last time that the axis shows
/// @param columns  of pixels that are drawn
std::string line_chart(const std::vector<double>& x, const std::vector<Line>& lines,
                       const std::pair<double, double>& x_range, const std::string& unit,
                       int height, int columns, const Backdrop& behind = {});

/// Mean of y where x lies in a bin, with its 95 % interval.
struct Bin {
  double x = 0.0;  ///< mean of x in the bin
  double mean = 0.0;
  double half = 0.0;  ///< half the interval's width; NaN if a single stay makes it up
};

/// Bins of equally many samples. Samples of one stay in a bin are not independent (a slow motion
/// gives many), stays are: the interval is that of clusters (Liang, Zeger 1986).
std::vector<Bin> binned(const std::vector<double>& x, const std::vector<double>& y, int bins);

/// Means as dots, intervals as bars, and the zero line.
std::string binned_chart(const std::vector<Bin>& bins, const std::string& x_unit,
                         const std::string& y_unit, int height);
/// A mean with its interval; NaN where there is none.
struct Band {
  const char* css_class;
  const std::vector<double>*mean, *low, *high;
};

/// Means over anything, with bands of their intervals and the zero line.
/// @param mark  a place on x to point at; NaN: none
std::string band_chart(const std::vector<double>& x, const std::vector<Band>& bands,
                       const std::string& x_title, const std::string& y_title, double mark);

/// One bar of a list of bars.
struct Bar {
  std::string label, text;  ///< to the left and to the right
  double begin = 0.0, end = 0.0;
  const char* css_class = "";
};

/// Bars below each other.
/// @param logarithmic  equal steps for equal ratios far above `knee`, for equal differences below
/// it (asinh); a line marks the knee
std::string bar_chart(const std::vector<Bar>& bars, bool logarithmic = false, double knee = 0.0);

/// One parameter: where it was (tick), where it is (dot), two standard errors to either side (bar).
std::string error_bar(double prior, double value, double std);

}  // namespace diffnea::report
