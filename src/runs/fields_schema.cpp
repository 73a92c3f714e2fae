#include "runs/fields_schema.hpp"

#include <cstring>
#include <regex>
#include <utility>

namespace diffnea::io {
namespace {

/// The schema of the object below a key.
Json& inner_object(Json& object, const std::string& key) {
  Json& properties = object["properties"];
  if (!properties.contains(key)) {
    properties[key] = {
        {"type", "object"}, {"required", Json::array()}, {"properties", Json::object()}};
    object["required"].push_back(key);
  }
  return properties[key];
}

}  // namespace

void put_property(Json& object, const char* path, Json&& property, bool required) {
  const std::size_t end = std::strcspn(path, ".[");
  const std::string key(path, end);
  if (path[end] == '.') {
    put_property(inner_object(object, key), path + end + 1, std::move(property), required);
    return;
  }
  Json& properties = object["properties"];
  const bool first = !properties.contains(key);
  if (path[end] == '[') {
    if (first) properties[key] = {{"type", "array"}, {"minItems", 2}, {"maxItems", 2}};
    properties[key]["prefixItems"].push_back(std::move(property));
  } else {
    properties[key] = std::move(property);
  }
  if (first && required) object["required"].push_back(key);
}

void describe(Json& property, const std::string& doc, const FieldTraits& traits) {
  static const std::pair<std::regex, const char*> changes[] = {
      {std::regex("[,;:] an? (list of )?:class:`[^`]*`"), ""},
      {std::regex(":class:`([^`]*)`"), "$1"},
      {std::regex("``"), "`"},
      {std::regex("\\b(None|NaN)\\b"), "null"}};
  std::string text = doc;
  for (const auto& [pattern, change] : changes) text = std::regex_replace(text, pattern, change);
  property["description"] = text;
  if (std::strcmp(traits.unit, "unit") == 0)
    property["unit"] = "`unit`";
  else if (*traits.unit)
    property["unit"] = traits.unit;
}

Json choices(const char* text) {
  Json out = Json::array();
  std::string rest = text;
  for (std::size_t end = rest.find('|'); end != std::string::npos; end = rest.find('|')) {
    out.push_back(rest.substr(0, end));
    rest.erase(0, end + 1);
  }
  out.push_back(rest);
  return out;
}

}  // namespace diffnea::io
