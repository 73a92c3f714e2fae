#include "fuzz/input_files.hpp"

#include <algorithm>
#include <fstream>

#include "support/temporary_folder.hpp"

namespace diffnea::fuzz {
namespace {

constexpr std::string_view kBegin = "=== ";

}  // namespace

InputFiles::InputFiles(std::string_view input, std::string_view own,
                       std::initializer_list<std::string_view> others) {
  std::string_view name = own;
  while (true) {
    // The next line that begins a file.
    std::size_t mark = input.starts_with(kBegin) ? 0 : input.npos;
    if (mark != 0) {
      mark = input.find("\n=== ");
      if (mark != input.npos) ++mark;
    }
    if (std::ranges::find(others, name) != others.end() || name == own)
      write(name, input.substr(0, mark));
    if (mark == input.npos) return;
    input.remove_prefix(mark + kBegin.size());
    const std::size_t end = input.find('\n');
    name = input.substr(0, end);
    input.remove_prefix(end == input.npos ? input.size() : end + 1);
  }
}

InputFiles::~InputFiles() {
  std::error_code ignored;
  for (const std::filesystem::path& path : written_) std::filesystem::remove(path, ignored);
}

const std::filesystem::path& InputFiles::folder() {
  static const test::TemporaryFolder kFolder;
  return kFolder.path();
}

void InputFiles::write(std::string_view name, std::string_view content) {
  const std::filesystem::path path = (*this)[name];
  std::ofstream(path, std::ios::binary) << content;
  written_.push_back(path);
}

}  // namespace diffnea::fuzz
