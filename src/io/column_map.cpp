#include <filesystem>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/column_map.hpp>

#include "io/json.hpp"

namespace diffnea {
namespace {

std::string trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::vector<ColumnName> in_file(const std::string& path) {
  const io::Json json = io::parse_json(read_text_file(path), path);
  if (!json.is_object())
    throw DataError(path + ": map: expected an object, {\"COLUMN\": \"q_JOINT [deg]\"}");
  std::vector<ColumnName> out;
  for (const auto& [from, to] : json.items()) {
    if (!to.is_string() && !to.is_null())
      throw DataError(path + ": map: " + from +
                      ": expected a column's name, or null to leave it out");
    out.push_back({from, to.is_null() ? "" : to.get<std::string>()});
  }
  return out;
}

}  // namespace

std::vector<ColumnName> parse_column_map(const std::string& text) {
  std::error_code ignored;
  if (text.ends_with(".json") || std::filesystem::is_regular_file(text, ignored))
    return in_file(text);
  std::vector<ColumnName> out;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string one = text.substr(begin, end - begin);
    begin = end + 1;
    // A unit may hold no sign of equality, a column's own name may: the last one counts.
    const std::size_t equal = one.rfind('=');
    if (equal == std::string::npos || trimmed(one.substr(0, equal)).empty())
      throw DataError("map: got '" + one +
                      "', expected COLUMN=NAME, e.g. \"gripper.pos=q_gripper [deg]\", several with "
                      "commas, or a JSON file");
    out.push_back({trimmed(one.substr(0, equal)), trimmed(one.substr(equal + 1))});
  }
  return out;
}

}  // namespace diffnea
