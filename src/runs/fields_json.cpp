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

long read_integer(JsonObject& object, const char* key) {
  const Json& value = object.required(key);
  const double x = json_number(value, object.at(key));
  constexpr double kExact = 9007199254740992.0;  // 2^53
  if (!value.is_number_integer() || !(std::abs(x) < kExact))
    throw ModelError(object.at(key) + ": got " + value.dump() + ", expected an integer");
  return value.get<long>();
}

std::uint64_t read_unsigned(JsonObject& object, const char* key) {
  const Json& value = object.required(key);
  if (!value.is_number_unsigned())
    throw ModelError(object.at(key) + ": got " + value.dump() + ", expected 0, 1, 2, …");
  return value.get<std::uint64_t>();
}

VecX<double> read_vector(JsonObject& object, const char* key) {
  const std::vector<double> x = json_numbers(object.required(key), object.at(key));
  return Eigen::Map<const VecX<double>>(x.data(), static_cast<long>(x.size()));
}

RowMatX<double> read_rows(JsonObject& object, const char* key) {
  const Json& rows = json_array(object.required(key), object.at(key));
  const long columns = rows.empty() ? 0 : static_cast<long>(rows[0].size());
  RowMatX<double> out(static_cast<long>(rows.size()), columns);
  for (long i = 0; i < out.rows(); ++i) {
    const std::vector<double> row = json_numbers(
        rows[static_cast<std::size_t>(i)], object.at(key) + "[" + std::to_string(i) + "]", columns);
    out.row(i) = Eigen::Map<const VecX<double>>(row.data(), columns).transpose();
  }
  return out;
}

void check_column(JsonObject& object, const char* key, std::size_t got, std::size_t expected) {
  if (got != expected)
    throw ModelError(object.at(key) + ": got " + std::to_string(got) + " numbers, expected " +
                     std::to_string(expected) + " (one per iteration)");
}

}  // namespace diffnea::io
