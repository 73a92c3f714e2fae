#pragma once
/// A number as messages show it. Internal.

#include <cstdio>
#include <string>

namespace diffnea::detail {

/// @param digits  that count, 17 at most
inline std::string number_text(double x, int digits = 4) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, x);
  return text;
}

}  // namespace diffnea::detail
