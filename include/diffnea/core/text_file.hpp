#pragma once
/// Whole files in, whole files out.

#include <filesystem>
#include <string>
#include <string_view>

namespace diffnea {

/// Replaces (or creates) the file with `content`. A crash leaves the old file or the new one.
/// @throws FileError with the path and the system's reason
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

/// Largest text file the readers accept [bytes]: a description of a robot has kilobytes; this stops
/// a device or a disk image that was named by mistake.
inline constexpr std::size_t kMaxTextFileSize = std::size_t{64} << 20;

/// Whole content of a text file.
/// @throws FileError if it cannot be read, is not a regular file, or is larger than `max_size`
/// [bytes]
std::string read_text_file(const std::filesystem::path& path,
                           std::size_t max_size = kMaxTextFileSize);

}  // namespace diffnea
