#include "report/format.hpp"

#include <algorithm>
#include <cmath>

#include "core/c_numbers.hpp"
#include "core/number_text.hpp"

namespace diffnea::report {

std::string number(double x, int digits) {
  if (std::isnan(x)) return "–";
  char text[40];
  detail::print(text, sizeof text, "%.*g", digits, x);
  return text;
}

std::string counted(std::size_t n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

std::string value_and_std(double value, double std) {
  return std::isnan(value) ? number(value) : detail::value_and_spread(value, std);
}

std::string percent(double share) {
  if (!std::isfinite(share)) return "–";
  char text[40];
  const double p = 100.0 * share;
  detail::print(text, sizeof text, p >= 99.95 ? "%.0f %%" : p >= 0.995 ? "%.1f %%" : "%.2f %%", p);
  return text;
}

std::string unit(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '*') {
      out += "·";
    } else if (text[i] == '^' && i + 1 < text.size() &&
               (text[i + 1] == '2' || text[i + 1] == '3')) {
      out += text[++i] == '2' ? "²" : "³";
    } else {
      out += text[i];
    }
  }
  return out;
}

std::size_t width(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

std::string table(const std::vector<std::string>& titles,
                  const std::vector<std::vector<std::string>>& rows) {
  const std::size_t columns = titles.size();
  std::vector<bool> left(columns, false);
  std::vector<std::string> heads = titles;
  std::vector<std::size_t> widths(columns);
  for (std::size_t c = 0; c < columns; ++c) {
    left[c] = c == 0 || heads[c].starts_with('<');
    if (heads[c].starts_with('<')) heads[c].erase(0, 1);
    widths[c] = width(heads[c]);
    for (const auto& row : rows) widths[c] = std::max(widths[c], width(row[c]));
  }
  std::string out;
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text = " ";
    for (std::size_t c = 0; c < columns; ++c) {
      const std::string pad(widths[c] - width(cells[c]), ' ');
      text += " " + (left[c] ? cells[c] + pad : pad + cells[c]) + (c + 1 < columns ? " " : "");
    }
    out += text.substr(0, text.find_last_not_of(' ') + 1) + "\n";
  };
  line(heads);
  for (const auto& row : rows) line(row);
  return out;
}

}  // namespace diffnea::report
