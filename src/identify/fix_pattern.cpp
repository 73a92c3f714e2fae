#include "identify/fix_pattern.hpp"

#include <charconv>
#include <cmath>

#include <diffnea/core/error.hpp>

namespace diffnea {

bool matches(const std::string& pattern, const std::string& name) {
  std::size_t p = 0, n = 0, star = std::string::npos, mark = 0;
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      mark = n;
    } else if (p < pattern.size() && pattern[p] == name[n]) {
      ++p, ++n;
    } else if (star != std::string::npos) {
      p = star + 1;
      n = ++mark;
    } else {
      return false;
    }
  }
  while (p < pattern.size() && pattern[p] == '*') ++p;
  return p == pattern.size();
}

std::pair<std::string, std::optional<double>> split_value(const std::string& entry) {
  const std::size_t equals = entry.rfind('=');
  if (equals == std::string::npos) return {entry, std::nullopt};
  double value = 0.0;
  const char* end = entry.data() + entry.size();
  const auto [last, error] = std::from_chars(entry.data() + equals + 1, end, value);
  if (error != std::errc() || last != end) return {entry, std::nullopt};
  return {entry.substr(0, equals), value};
}

void require_possible(const std::string& entry, const std::string& name, double value, Sign sign) {
  if (!std::isfinite(value) || (sign != Sign::kFree && value < 0.0) ||
      (sign == Sign::kPositive && value == 0.0))
    throw ModelError("fix: got '" + entry + "'; " + name +
                     " cannot be that: expected a finite number" +
                     (sign == Sign::kFree       ? ""
                      : sign == Sign::kPositive ? ", above 0"
                                                : ", not negative"));
}

}  // namespace diffnea
