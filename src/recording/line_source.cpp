#include "recording/line_source.hpp"

#include <cstring>

#include <diffnea/core/error.hpp>

namespace diffnea::detail {

LineSource::LineSource(const std::filesystem::path& path, const std::string& what,
                       const std::string& name)
    : name_(name.empty() ? path.string() : name) {
  std::error_code ignored;
  file_.reset(std::filesystem::is_directory(path, ignored) ? nullptr
                                                           : std::fopen(path.c_str(), "rb"));
  if (!file_)
    throw FileError(name_ + ": the " + what + " cannot be opened; expected a readable CSV file");
  buffer_.resize(2 * kMaxLine);
}

bool LineSource::next(std::string_view& line) {
  while (true) {
    const char* begin = buffer_.data() + begin_;
    const void* newline = std::memchr(begin, '\n', end_ - begin_);
    if (newline != nullptr || (at_end_ && begin_ < end_)) {
      terminated_ = newline != nullptr;
      const char* last = terminated_ ? static_cast<const char*>(newline) : buffer_.data() + end_;
      begin_ = last - buffer_.data() + (terminated_ ? 1 : 0);
      if (last > begin && last[-1] == '\r') --last;
      line = {begin, static_cast<std::size_t>(last - begin)};
      ++number_;
      return true;
    }
    if (at_end_) return false;
    if (end_ - begin_ > kMaxLine)
      throw DataError(name_ + ":" + std::to_string(number_ + 1) + ": the line is longer than " +
                      std::to_string(kMaxLine >> 20) +
                      " MiB, expected rows of numbers: is it a CSV file?");
    std::memmove(buffer_.data(), begin, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    const std::size_t got =
        std::fread(buffer_.data() + end_, 1, buffer_.size() - end_, file_.get());
    if (std::ferror(file_.get()) != 0)
      throw FileError(name_ + ": reading fails after line " + std::to_string(number_) +
                      "; expected a file whose medium can be read to its end");
    end_ += got;
    at_end_ = got == 0;
  }
}

}  // namespace diffnea::detail
