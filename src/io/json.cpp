#include "io/json.hpp"

#include <algorithm>

namespace diffnea::io {
namespace {

/// Whoever walks deeper runs out of stack sooner or later; an object's keys are searched one by
/// one; and a value takes 16 bytes and more however short its text is.
constexpr std::size_t kMaxDepth = 64, kMaxKeys = 1000, kMaxValues = 5'000'000;

/// Before the parser builds anything. Of a text that is not JSON any answer will do.
void check_json_limits(std::string_view text, const std::string& where) {
  const auto refuse = [&](const char* what, std::size_t limit) {
    throw ModelError(where + ": " + what + "; the limit is " + std::to_string(limit));
  };
  std::vector<std::size_t> keys;  // of the objects and lists that are open
  std::size_t values = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"')
      in_string = !in_string;
    else if (in_string)
      i += c == '\\' ? 1 : 0;
    else if (c == '[' || c == '{')
      ++values, keys.push_back(0);
    else if ((c == ']' || c == '}') && !keys.empty())
      keys.pop_back();
    else if (c == ',')
      ++values;
    else if (c == ':' && !keys.empty() && ++keys.back() > kMaxKeys)
      refuse("an object has too many keys", kMaxKeys);
    if (keys.size() > kMaxDepth) refuse("lists and objects are nested too deeply", kMaxDepth);
    if (values > kMaxValues) refuse("holds too many values", kMaxValues);
  }
}

[[noreturn]] void wrong_type(const Json& value, const std::string& where, const char* expected) {
  std::string got = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (got.size() > 40) got = got.substr(0, 40) + "…";
  throw ModelError(where + ": got " + got + ", expected " + expected);
}

}  // namespace

bool has_room(std::string_view json) {
  try {
    check_json_limits(json, "");
  } catch (const ModelError&) {
    return false;
  }
  return true;
}

Json parse_json(std::string_view text, const std::string& where) {
  check_json_limits(text, where);
  try {
    return Json::parse(text);
  } catch (const Json::exception& error) {
    std::string reason = error.what();  // "[json.exception.parse_error.101] parse error at line …"
    if (const std::size_t end = reason.find("] "); end != std::string::npos)
      reason.erase(0, end + 2);
    throw ModelError(where + ": is not JSON: " + reason);
  }
}

double json_number(const Json& value, const std::string& where) {
  if (!value.is_number()) wrong_type(value, where, "a number");
  const double x = value.get<double>();
  if (!std::isfinite(x)) wrong_type(value, where, "a finite number");
  return x;
}

std::string json_string(const Json& value, const std::string& where) {
  if (!value.is_string()) wrong_type(value, where, "a string");
  return value.get<std::string>();
}

const Json& json_array(const Json& value, const std::string& where) {
  if (!value.is_array()) wrong_type(value, where, "a list");
  return value;
}

std::vector<double> json_numbers(const Json& value, const std::string& where, long size) {
  json_array(value, where);
  if (size >= 0 && value.size() != static_cast<std::size_t>(size))
    throw ModelError(where + ": got " + std::to_string(value.size()) + " numbers, expected " +
                     std::to_string(size));
  std::vector<double> out;
  for (std::size_t i = 0; i < value.size(); ++i)
    out.push_back(json_number(value[i], where + "[" + std::to_string(i) + "]"));
  return out;
}

JsonObject::JsonObject(const Json& value, std::string where)
    : value_(value), where_(std::move(where)) {
  if (!value.is_object()) wrong_type(value, where_, "an object");
}

const Json& JsonObject::required(const char* key) {
  known_.emplace_back(key);
  const auto it = value_.find(key);
  if (it == value_.end()) throw ModelError(where_ + ": key '" + key + "' is missing");
  return *it;
}

const Json* JsonObject::optional(const char* key) {
  known_.emplace_back(key);
  const auto it = value_.find(key);
  return it == value_.end() || it->is_null() ? nullptr : &*it;
}

double JsonObject::number_or(const char* key, double fallback) {
  const Json* value = optional(key);
  return value ? json_number(*value, at(key)) : fallback;
}

std::string JsonObject::string_or(const char* key, const std::string& fallback) {
  const Json* value = optional(key);
  return value ? json_string(*value, at(key)) : fallback;
}

bool JsonObject::boolean_or(const char* key, bool fallback) {
  const Json* value = optional(key);
  if (!value) return fallback;
  if (!value->is_boolean()) wrong_type(*value, at(key), "true or false");
  return value->get<bool>();
}

void JsonObject::finish() const {
  for (const auto& item : value_.items()) {
    if (std::ranges::find(known_, item.key()) != known_.end()) continue;
    std::string names;
    for (const std::string& k : known_) names += (names.empty() ? "" : ", ") + k;
    throw ModelError(where_ + ": unknown key '" + item.key() + "'; keys: " + names);
  }
}

}  // namespace diffnea::io
