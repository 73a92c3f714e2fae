#include <cerrno>
#include <cstring>
#include <fstream>

#include <diffnea/core/atomic_file.hpp>
#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>

namespace diffnea {

void write_file_atomically(const std::filesystem::path& path, std::string_view content) {
  AtomicFile file(path);
  file.write(content);
  file.commit();
}

namespace {

[[noreturn]] void refuse(const std::filesystem::path& path, int error) {
  throw FileError(path.string() + ": cannot be read (" + std::strerror(error) + ")");
}

}  // namespace

std::string read_text_file(const std::filesystem::path& path, std::size_t max_size) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw FileError(path.string() + ": there is no such file");
  if (!std::filesystem::is_regular_file(status))
    throw FileError(path.string() + ": is not a file (" +
                    (std::filesystem::is_directory(status) ? "a folder" : "a device or a pipe") +
                    ")");
  std::ifstream in(path, std::ios::binary);
  if (!in) refuse(path, errno);
  std::string content;
  char buffer[1 << 16];
  while (in.read(buffer, sizeof buffer) || in.gcount() > 0) {
    content.append(buffer, static_cast<std::size_t>(in.gcount()));
    if (content.size() > max_size)
      throw FileError(path.string() + ": is larger than " + std::to_string(max_size >> 20) +
                      " MiB, the limit for such a file");
  }
  if (in.bad()) refuse(path, errno);
  return content;
}

}  // namespace diffnea
