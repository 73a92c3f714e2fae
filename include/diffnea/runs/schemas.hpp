#pragma once
/// JSON Schemas of result files, made from the field lists of their types (diffnea/core/fields.hpp)
/// like the files themselves. The pages of docs/schema and the tests read them.

#include <string>
#include <vector>

namespace diffnea {

/// "identify", "series", "diagnose", …: NAME of the files' "diffnea/NAME/1".
std::vector<std::string> schema_names();

/// JSON Schema (draft 2020-12) of one of these files; `unit` beside a `description` is in SI.
/// @throws Error naming the choices
std::string json_schema(const std::string& name);

}  // namespace diffnea
