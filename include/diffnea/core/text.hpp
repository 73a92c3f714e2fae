#pragma once
/// Numbers and lists as messages show them. Internal.

#include <charconv>
#include <string>
#include <vector>

namespace diffnea::detail {

/// printf's %.*g, with a point in every locale.
/// @param digits  significant digits, at most 17
inline std::string number_text(double x, int digits = 4) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, x, std::chars_format::general, digits).ptr};
}

/// "a, b, c"
inline std::string join(const std::vector<std::string>& items, const std::string& between = ", ") {
  std::string out;
  for (const std::string& item : items) out += (out.empty() ? "" : between) + item;
  return out;
}

/// "a, b, c", or "none"
inline std::string join_or_none(const std::vector<std::string>& items) {
  return items.empty() ? "none" : join(items);
}

}  // namespace diffnea::detail
