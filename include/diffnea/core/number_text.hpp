#pragma once
/// A number as messages show it. Internal.

#include <charconv>
#include <string>

namespace diffnea::detail {

/// printf's %.*g, with a point in every locale.
/// @param digits  significant digits, at most 17
inline std::string number_text(double x, int digits = 4) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, x, std::chars_format::general, digits).ptr};
}

}  // namespace diffnea::detail
