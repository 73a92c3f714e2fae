#include "runs/run_reader.hpp"

#include <cmath>
#include <limits>

#include <diffnea/core/text_file.hpp>

namespace diffnea {
namespace io {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Json run_file(const std::filesystem::path& folder, const char* name) {
  const std::filesystem::path path = folder / name;
  if (!std::filesystem::exists(path))
    throw FileError(folder.string() + ": holds no " + name + "; expected the folder of a run");
  return parse_json(read_text_file(path), path.string());
}

double number_or_nan(JsonObject& object, const char* key) { return object.number_or(key, kNaN); }

long count(JsonObject& object, const char* key) {
  const double x = object.number_or(key, 0.0);
  constexpr double kExact = 9007199254740992.0;  // 2^53
  if (!(std::abs(x) <= kExact))
    throw ModelError(object.at(key) + ": got " + Json(x).dump() + ", which is too large");
  return static_cast<long>(x);
}

std::vector<std::string> strings(JsonObject& object, const char* key) {
  std::vector<std::string> out;
  if (const Json* list = object.optional(key))
    for (const Json& item : json_array(*list, object.at(key)))
      out.push_back(json_string(item, object.at(key)));
  return out;
}

std::vector<double> column(JsonObject& object, const char* key) {
  std::vector<double> out;
  for (const Json& item : json_array(object.required(key), object.at(key)))
    out.push_back(item.is_null() ? kNaN : json_number(item, object.at(key)));
  return out;
}

}  // namespace io

std::string run_schema(const std::filesystem::path& folder, const char* name) {
  const io::Json document = io::run_file(folder, name);
  io::JsonObject root(document, (folder / name).string());
  return root.string("schema");
}

}  // namespace diffnea
