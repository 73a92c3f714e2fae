#include "report/svg.hpp"

#include "core/c_numbers.hpp"
#include "report/html.hpp"

namespace diffnea::report {

Range Range::widened(double share) const {
  if (empty()) return {0.0, 1.0};
  const double margin = high > low ? share * (high - low) : std::max(0.5 * std::abs(low), 0.5);
  return {low - margin, high + margin};
}

std::vector<double> ticks(const Range& range, int count) {
  const double raw = (range.high - range.low) / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double step = power * (raw / power < 1.5   ? 1.0
                               : raw / power < 3.5 ? 2.0
                               : raw / power < 7.5 ? 5.0
                                                   : 10.0);
  const double first = std::ceil(range.low / step);
  std::vector<double> out;
  for (int k = 0; k <= 2 * count; ++k)  // bounded: of a huge number, one step more may be none
    if (const double t = (first + k) * step; t <= range.high) out.push_back(t + 0.0);  // never −0
  return out;
}

std::string coordinate(double x) {
  char text[32];
  detail::print(text, sizeof text, "%.1f", x);
  return text;
}

std::string text_at(double x, double y, const char* anchor, const std::string& text) {
  return "<text x='" + coordinate(x) + "' y='" + coordinate(y) + "' text-anchor='" + anchor + "'>" +
         escape(text) + "</text>";
}

std::string segment(const char* css_class, double x1, double y1, double x2, double y2) {
  return std::string("<line class='") + css_class + "' x1='" + coordinate(x1) + "' y1='" +
         coordinate(y1) + "' x2='" + coordinate(x2) + "' y2='" + coordinate(y2) + "'/>";
}

std::string box(const char* css_class, double x, double y, double width, double height) {
  return std::string("<rect class='") + css_class + "' x='" + coordinate(x) + "' y='" +
         coordinate(y) + "' width='" + coordinate(width) + "' height='" + coordinate(height) +
         "'/>";
}

}  // namespace diffnea::report
