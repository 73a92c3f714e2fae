#pragma once
/// Files that are never seen half-written: the content goes to a temporary file in the same folder,
/// reaches the disk, and then takes the name.

#include <filesystem>
#include <string_view>

namespace diffnea {

/// A file that is written piece by piece, and takes its name once it is whole.
///
///     AtomicFile file("long.csv");  // fails now, not after the work
///     for (...) file.write(row);
///     file.commit();                // without it nothing changes
///
/// What programs that were killed had begun to write of the same file goes. The file that is
/// replaced leaves its permissions; a link to it stays a link. What is no file (a device, a pipe)
/// is written into as it is: it has no old content that could be lost.
class AtomicFile {
 public:
  /// @throws FileError with the path and the system's reason, as do the others
  explicit AtomicFile(const std::filesystem::path& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Adds to what will be the file. @throws FileError
  void write(std::string_view content);
  /// Has the content reach the disk, and the file its name.
  void commit();

 private:
  std::filesystem::path path_, target_;  ///< as it was called, and where links lead
  std::filesystem::path temporary_;      ///< empty: none
  int file_ = -1;
};

}  // namespace diffnea
