#pragma once
/// A number with its spread, as messages show it. Internal.

#include <algorithm>
#include <cmath>
#include <string>

#include <diffnea/core/text.hpp>

#include "core/c_numbers.hpp"

namespace diffnea::detail {

/// A value and its spread (a standard error, half an interval) to two digits of that: "0.530 ±
/// 0.021"; the value alone without one.
inline std::string value_and_spread(double value, double spread) {
  if (!(spread > 0.0) || !std::isfinite(spread)) return number_text(value);
  const int magnitude = static_cast<int>(std::floor(std::log10(spread)));
  const int decimals = std::max(0, 1 - magnitude);
  char text[400];
  if (decimals > 6 || spread >= 1e6) {
    const int digits =
        std::abs(value) > spread
            ? 2 + static_cast<int>(std::floor(std::log10(std::abs(value)))) - magnitude
            : 2;
    print(text, sizeof text, "%.*g ± %.2g", digits, value, spread);
  } else {
    const double shown =
        std::abs(value) <= 0.5 * std::pow(10.0, -decimals) ? 0.0 : value;  // not −0
    print(text, sizeof text, "%.*f ± %.*f", decimals, shown, decimals, spread);
  }
  return text;
}

/// A value and its 95 % interval: "0.530 ± 0.021", or "0.353 (0.15 to 0.83)" where it is not in the
/// middle; "0.530 (held)" without one.
inline std::string value_and_interval(double value, double low, double high) {
  if (!std::isfinite(low) || !std::isfinite(high)) return number_text(value) + " (held)";
  const double up = high - value, down = value - low;
  if (std::abs(up - down) <= 0.1 * (up + down)) return value_and_spread(value, 0.5 * (up + down));
  return number_text(value, 3) + " (" + number_text(low, 3) + " to " + number_text(high, 3) + ")";
}

}  // namespace diffnea::detail
