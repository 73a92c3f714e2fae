#include "recording/csv_row.hpp"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <string>

#include <diffnea/core/error.hpp>

#include "core/c_numbers.hpp"
#include "core/constants.hpp"

namespace diffnea::detail {
namespace {

/// A cell that std::from_chars did not take whole: empty or NA is a gap, a number out of range is
/// infinite or 0.
/// @return false if it is no number
bool parse_odd_cell(std::string_view cell, double& out) {
  const auto drop = [&](std::string_view chars) {
    while (!cell.empty() && chars.find(cell.front()) != chars.npos) cell.remove_prefix(1);
    while (!cell.empty() && chars.find(cell.back()) != chars.npos) cell.remove_suffix(1);
  };
  drop(" \t\r");
  if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') drop("\"");
  drop(" \t");
  out = kNaN;
  if (cell.empty() || cell == "NA" || cell == "N/A" || cell == "null") return true;
  if (cell.front() == '+') cell.remove_prefix(1);
  const char* end = cell.data() + cell.size();
  const auto [last, error] = std::from_chars(cell.data(), end, out);
  if (error == std::errc::result_out_of_range) {
    const detail::CNumbers point;
    out = std::strtod(std::string(cell).c_str(), nullptr);
  }
  return error != std::errc::invalid_argument && last == end;
}

[[noreturn]] void fail(const LineSource& lines, std::size_t column, const std::string& what) {
  throw DataError(lines.name() + ":" + std::to_string(lines.number()) + ":" +
                  std::to_string(column + 1) + ": " + what);
}

}  // namespace

bool parse_row(std::string_view line, const LineSource& lines, const Columns& header,
               std::vector<double>& row, std::vector<long>& text_cells) {
  const std::size_t num_columns = header.columns.size();
  row.resize(num_columns);
  const char* p = line.data();
  const char* const end = p + line.size();
  std::size_t k = 0;
  while (k < num_columns) {
    while (p != end && *p == ' ') ++p;
    double x = kNaN;
    const auto [last, error] = std::from_chars(p, end, x);
    if (error == std::errc() && (last == end || *last == ',')) {
      p = last;
    } else {
      const void* comma = std::memchr(p, ',', end - p);
      const char* cell_end = comma != nullptr ? static_cast<const char*>(comma) : end;
      const std::string_view cell(p, cell_end - p);
      if (!parse_odd_cell(cell, x)) {
        const Column& c = header.columns[k];
        // "1e", "-" at the very end of the file: the beginning of a number.
        const bool is_beginning = cell.find_first_not_of("0123456789+-.eE") == cell.npos;
        if (!lines.terminated() && cell_end == end && is_beginning) return false;
        if (c.channel != Channel::kExtra && c.channel != Channel::kLeftOut)
          fail(lines, k,
               "'" + std::string(cell.substr(0, 40)) + "' in column '" + c.name +
                   "' is no number; an empty cell or NaN marks a gap");
        if (c.channel == Channel::kExtra) ++text_cells[c.index];
        x = kNaN;
      }
      p = cell_end;
    }
    row[k] = header.columns[k].conversion(x);
    ++k;
    if (p == end || k == num_columns) break;
    ++p;  // the comma
  }
  if (k == num_columns && p == end) return true;
  if (k < num_columns && !lines.terminated()) return false;
  const std::size_t got = 1 + std::ranges::count(line, ',');
  fail(lines, std::min(got, num_columns),
       "the row has " + std::to_string(got) + " cells, the header " + std::to_string(num_columns));
}

}  // namespace diffnea::detail
