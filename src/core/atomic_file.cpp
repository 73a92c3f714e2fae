#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

#include <diffnea/core/atomic_file.hpp>
#include <diffnea/core/error.hpp>

namespace diffnea {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, int error) {
  throw FileError(path.string() + ": cannot be written (" + std::strerror(error) + ")");
}

/// Name of a temporary file: this, the file's name, '.', the process, '.', a number, ".tmp".
constexpr std::string_view kHidden = ".", kTemporary = ".tmp";

std::string temporary_stem(const fs::path& path) {
  return std::string(kHidden) + path.filename().string() + ".";
}

/// Removes what programs that no longer run had begun to write of a file.
void remove_abandoned(const fs::path& folder, const fs::path& path) {
  const std::string stem = temporary_stem(path);
  std::error_code error;
  std::vector<fs::path> abandoned;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (!name.starts_with(stem) || !name.ends_with(kTemporary)) continue;
    pid_t pid = 0;
    const char* const last = name.data() + name.size();
    const auto [rest, wrong] = std::from_chars(name.data() + stem.size(), last, pid);
    if (wrong != std::errc() || rest == last || *rest != '.' || pid <= 0) continue;
    if (::kill(pid, 0) != 0 && errno == ESRCH) abandoned.push_back(it->path());
  }
  for (const fs::path& leftover : abandoned) fs::remove(leftover, error);
}

}  // namespace

AtomicFile::AtomicFile(const fs::path& path) : path_(path), target_(path) {
  std::error_code error;
  if (fs::is_symlink(path_, error)) {
    const fs::path real = fs::canonical(path_, error);
    if (!error) target_ = real;
  }
  struct stat before = {};
  const bool exists = ::stat(target_.c_str(), &before) == 0;
  if (exists && !S_ISREG(before.st_mode) && !S_ISDIR(before.st_mode)) {
    file_ = ::open(target_.c_str(), O_WRONLY | O_CLOEXEC);
    if (file_ < 0) fail(path_, errno);
    return;
  }
  static std::atomic<unsigned> counter{0};
  const fs::path folder = target_.has_parent_path() ? target_.parent_path() : ".";
  remove_abandoned(folder, target_);
  temporary_ = folder / (temporary_stem(target_) + std::to_string(::getpid()) + "." +
                         std::to_string(counter++) + std::string(kTemporary));
  // One of this name can only be of an earlier process with our number.
  ::unlink(temporary_.c_str());
  file_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file_ < 0) {
    const int reason = errno;
    temporary_.clear();
    fail(path_, reason);
  }
  if (exists) ::fchmod(file_, before.st_mode & 07777);  // not possible: those of a new file
}

AtomicFile::~AtomicFile() {
  if (file_ >= 0) ::close(file_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::write(std::string_view content) {
  while (!content.empty()) {
    const ssize_t n = ::write(file_, content.data(), content.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path_, errno);
    content.remove_prefix(static_cast<std::size_t>(n));
  }
}

void AtomicFile::commit() {
  // A device or a pipe has no disk to reach.
  if (::fsync(file_) != 0 && !temporary_.empty()) fail(path_, errno);
  const int file = file_;
  file_ = -1;
  if (::close(file) != 0) fail(path_, errno);
  if (temporary_.empty()) return;
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail(path_, errno);
  temporary_.clear();
  // The name itself is durable once the folder is; some file systems refuse to sync a folder.
  const fs::path folder = target_.has_parent_path() ? target_.parent_path() : ".";
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory < 0) return;
  ::fsync(directory);
  ::close(directory);
}

}  // namespace diffnea
