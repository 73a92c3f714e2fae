#pragma once
/// The lines of a text file one by one, in memory that does not grow with it. Internal.

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace diffnea::detail {

/// A thousand columns of twenty characters are 20 kB.
inline constexpr std::size_t kMaxLine = std::size_t{1} << 20;  // [bytes]

/// Lines of a file, read in large pieces.
class LineSource {
 public:
  /// @param what  the file is, for messages
  /// @param name  to call it by in messages; empty: the path
  /// @throws FileError if the file cannot be opened
  explicit LineSource(const std::filesystem::path& path, const std::string& what = "recording",
                      const std::string& name = "");

  /// @param line  without its end, valid until the next call  @return false at the end of the file
  /// @throws DataError if the line is longer than kMaxLine: the file is of another kind
  bool next(std::string_view& line);

  const std::string& name() const { return name_; }  ///< of the file, for messages
  long number() const { return number_; }            ///< of the last line, from 1
  bool terminated() const { return terminated_; }    ///< the last line had a line feed

 private:
  struct FileCloser {
    void operator()(std::FILE* f) const { std::fclose(f); }
  };

  std::string name_;
  std::unique_ptr<std::FILE, FileCloser> file_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;
  bool at_end_ = false, terminated_ = true;
  long number_ = 0;
};

}  // namespace diffnea::detail
