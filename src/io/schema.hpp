#pragma once
/// Of which format and version a file is: its key `schema`, "diffnea/NAME/VERSION". A version is
/// read as long as it lives: keys that came later are optional, a change of meaning is a new
/// number.

#include <string>

#include "io/json.hpp"

namespace diffnea::io {

/// Whether `schema` is of the format of `expected`, and of a later version.
bool is_newer(const std::string& schema, const std::string& expected);

/// @throws ModelError that names both and, of a file of a later version, what to do
void require_schema(JsonObject& root, const std::string& where, const std::string& expected);

}  // namespace diffnea::io
