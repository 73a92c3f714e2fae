#include "io/schema.hpp"

#include <charconv>
#include <string_view>

#include <diffnea/version.hpp>

namespace diffnea::io {
namespace {

/// 0: it has none.
int version_of(std::string_view schema) {
  const std::string_view digits = schema.substr(schema.rfind('/') + 1);
  int out = 0;
  const auto [last, error] = std::from_chars(digits.data(), digits.data() + digits.size(), out);
  return error == std::errc() && last == digits.data() + digits.size() ? out : 0;
}

std::string_view name_of(std::string_view schema) { return schema.substr(0, schema.rfind('/')); }

}  // namespace

bool is_newer(const std::string& schema, const std::string& expected) {
  return name_of(schema) == name_of(expected) && version_of(schema) > version_of(expected);
}

void require_schema(JsonObject& root, const std::string& where, const std::string& expected) {
  const std::string got = root.string("schema");
  if (got == expected) return;
  std::string text = where + ": its schema is " + got + ", expected " + expected;
  if (is_newer(got, expected))
    text += "; it was written by a newer diffnea than this one (" + std::string(version()) +
            "), which reads it: update, or write it again with this one";
  throw ModelError(text);
}

}  // namespace diffnea::io
