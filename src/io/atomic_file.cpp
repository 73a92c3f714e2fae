#include <atomic>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <sys/stat.h>
#include <unistd.h>

#include <diffnea/core/error.hpp>
#include <diffnea/io/atomic_file.hpp>

namespace diffnea {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const char* verb, int error) {
  throw FileError(path.string() + ": cannot be " + verb + " (" + std::strerror(error) + ")");
}

/// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int release() {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }

 private:
  int fd_;
};

/// Removes the temporary file unless it took its final name.
struct Cleanup {
  std::string path;
  bool armed = true;
  ~Cleanup() {
    if (armed) ::unlink(path.c_str());
  }
};

}  // namespace

void write_file_atomically(const std::filesystem::path& path, std::string_view content) {
  static std::atomic<unsigned> counter{0};
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  const std::string temporary =
      (folder / ("." + path.filename().string() + "." + std::to_string(::getpid()) + "." +
                 std::to_string(counter++) + ".tmp"))
          .string();
  {
    Descriptor file(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
    if (file.get() < 0) fail(path, "written", errno);
    Cleanup cleanup{temporary};
    while (!content.empty()) {
      const ssize_t n = ::write(file.get(), content.data(), content.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail(path, "written", errno);
      content.remove_prefix(static_cast<std::size_t>(n));
    }
    if (::fsync(file.get()) != 0) fail(path, "written", errno);
    if (::close(file.release()) != 0) fail(path, "written", errno);
    if (::rename(temporary.c_str(), path.c_str()) != 0) fail(path, "written", errno);
    cleanup.armed = false;
  }
  // The name itself is durable once the folder is; some file systems refuse to sync a folder.
  const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (directory.get() >= 0) ::fsync(directory.get());
}

std::string read_text_file(const std::filesystem::path& path, std::size_t max_size) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw FileError(path.string() + ": there is no such file");
  if (!std::filesystem::is_regular_file(status))
    throw FileError(path.string() + ": is not a file (" +
                    (std::filesystem::is_directory(status) ? "a folder" : "a device or a pipe") +
                    ")");
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(path, "read", errno);
  std::string content;
  char buffer[1 << 16];
  while (in.read(buffer, sizeof buffer) || in.gcount() > 0) {
    content.append(buffer, static_cast<std::size_t>(in.gcount()));
    if (content.size() > max_size)
      throw FileError(path.string() + ": is larger than " + std::to_string(max_size >> 20) +
                      " MiB, the limit for such a file");
  }
  if (in.bad()) fail(path, "read", errno);
  return content;
}

}  // namespace diffnea
