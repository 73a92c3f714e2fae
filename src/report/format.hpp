#pragma once
/// Numbers and units as people read them.

#include <string>
#include <string_view>
#include <vector>

namespace diffnea::report {

/// Four significant digits; "–" for NaN.
std::string number(double x, int digits = 4);
/// A value with its standard error to two digits: "1.234 ± 0.056"; the value alone without one.
std::string value_and_std(double value, double std);
/// "1 note", "2 notes".
std::string counted(std::size_t n, const char* one, const char* many);
/// "12.3 %"; "–" for NaN.
std::string percent(double share);
/// "N·m" for "N*m", "kg·m²" for "kg*m^2".
std::string unit(std::string_view text);
/// Characters that a terminal shows, for UTF-8 text without combining marks.
std::size_t width(std::string_view text);

/// A table in columns; the first is aligned left, a column whose title starts with '<' too.
std::string table(const std::vector<std::string>& titles,
                  const std::vector<std::vector<std::string>>& rows);

}  // namespace diffnea::report
