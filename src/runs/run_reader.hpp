#pragma once
/// What readers of a run's result.json and series.json share. Keys that are not known are passed
/// over: a later version may have more.

#include <diffnea/runs/result.hpp>

#include "io/json.hpp"
#include "io/schema.hpp"

namespace diffnea::io {

/// A parsed file of a folder. @throws FileError, ModelError
Json run_file(const std::filesystem::path& folder, const char* name);

/// NaN where it is null or missing.
double number_or_nan(JsonObject& object, const char* key);
/// 0 where it is null or missing.
long count(JsonObject& object, const char* key);
std::vector<std::string> strings(JsonObject& object, const char* key);
/// A list of numbers in which null is NaN.
std::vector<double> column(JsonObject& object, const char* key);

/// Calls use(object) with every item of a list of objects.
template <typename Use>
void for_each_object(JsonObject& parent, const char* key, const Use& use) {
  const Json* list = parent.optional(key);
  if (!list) return;
  int k = 0;
  for (const Json& item : json_array(*list, parent.at(key))) {
    JsonObject object(item, parent.at(key) + "[" + std::to_string(k++) + "]");
    use(object);
  }
}

}  // namespace diffnea::io
