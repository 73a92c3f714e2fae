#include "runs/fields_json.hpp"

#include <cmath>
#include <cstdlib>
#include <cstring>

namespace diffnea::io {

void put(Json& out, const char* path, Json&& value) {
  const std::size_t end = std::strcspn(path, ".[");
  const std::string key(path, end);
  if (path[end] == '.')
    put(out[key], path + end + 1, std::move(value));
  else if (path[end] == '[')
    out[key].push_back(std::move(value));
  else
    out[key] = std::move(value);
}

std::vector<double> thinned(const std::vector<double>& values, long most) {
  const std::size_t limit = static_cast<std::size_t>(most),
                    stride = most > 0 ? (values.size() + limit - 1) / limit : 1;
  if (stride <= 1) return values;
  std::vector<double> out;
  for (std::size_t k = 0; k < values.size(); k += stride) out.push_back(values[k]);
  return out;
}

PathEnd follow(JsonObject& object, const char* path, bool optional) {
  PathEnd out;
  for (std::size_t end = std::strcspn(path, ".["); path[end] == '.';
       path += end + 1, end = std::strcspn(path, ".[")) {
    const std::string key(path, end);
    JsonObject& outer = out.in(object);
    const Json* inner = optional ? outer.optional(key.c_str()) : &outer.required(key.c_str());
    if (!inner) {
      out.missing = true;
      return out;
    }
    out.object.emplace(JsonObject(*inner, outer.at(key.c_str())));
  }
  const std::size_t end = std::strcspn(path, "[");
  out.key.assign(path, end);
  if (path[end] == '[') out.index = std::atoi(path + end + 1);
  return out;
}

double interval_end(JsonObject& object, const char* key, int index) {
  if (!object.optional(key)) return std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> ends = column(object, key);
  if (ends.size() != 2)
    throw ModelError(object.at(key) + ": has " + std::to_string(ends.size()) +
                     " numbers, expected the 2 ends of an interval");
  return ends[static_cast<std::size_t>(index)];
}

std::vector<int> integers(JsonObject& object, const char* key) {
  std::vector<int> out;
  for (const double x : json_numbers(object.required(key), object.at(key))) {
    if (!(std::abs(x) <= std::numeric_limits<int>::max()))
      throw ModelError(object.at(key) + ": got " + Json(x).dump() + ", which is too large");
    out.push_back(static_cast<int>(x));
  }
  return out;
}

}  // namespace diffnea::io
