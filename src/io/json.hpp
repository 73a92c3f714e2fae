#pragma once
/// Strict reading of JSON objects: every key is known, every value has its type, every message says
/// where. nlohmann/json is included by src/io alone.

#include <cmath>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include <diffnea/core/error.hpp>

namespace diffnea::io {

using Json = nlohmann::ordered_json;

/// Parses a whole text. @throws ModelError `where: is not JSON: …`; also for one that no program of
/// ours writes: lists in lists beyond 64, objects of more than 1000 keys, 5 million values
Json parse_json(std::string_view text, const std::string& where);

/// Whether parse_json takes a text of so many values.
bool has_room(std::string_view json);

/// A finite number. @throws ModelError
double json_number(const Json& value, const std::string& where);
std::string json_string(const Json& value, const std::string& where);
/// A list of finite numbers; `size` < 0 takes any length. @throws ModelError
std::vector<double> json_numbers(const Json& value, const std::string& where, long size = -1);
const Json& json_array(const Json& value, const std::string& where);

/// An object whose keys are taken one by one; `finish` refuses what nobody took.
class JsonObject {
 public:
  /// @throws ModelError if the value is not an object
  JsonObject(const Json& value, std::string where);

  /// @throws ModelError if it is missing
  const Json& required(const char* key);
  /// nullptr if it is missing or null
  const Json* optional(const char* key);
  /// `where.key`, for messages about the value of a key.
  std::string at(const char* key) const { return where_ + "." + key; }

  double number(const char* key) { return json_number(required(key), at(key)); }
  double number_or(const char* key, double fallback);
  std::string string(const char* key) { return json_string(required(key), at(key)); }
  std::string string_or(const char* key, const std::string& fallback);
  bool boolean_or(const char* key, bool fallback);

  /// @throws ModelError naming the unknown key and all known ones
  void finish() const;

 private:
  const Json& value_;
  std::string where_;
  std::vector<std::string> known_;
};

}  // namespace diffnea::io
