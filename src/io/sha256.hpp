#pragma once
/// SHA-256 (FIPS 180-4), to say which files a result came from.

#include <string>
#include <string_view>

namespace diffnea::io {

/// Lower-case hexadecimal digest, 64 characters.
std::string sha256(std::string_view data);

}  // namespace diffnea::io
