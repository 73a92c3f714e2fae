#pragma once
/// An input as the files that a reader expects. A line `=== NAME` begins a file; what comes before
/// the first such line goes to the target's own file:
///
///     time,q_elbow,tau_elbow
///     0,1,2
///     === data.json
///     {"period": 10}

#include <filesystem>
#include <initializer_list>
#include <string_view>
#include <vector>

namespace diffnea::fuzz {

class InputFiles {
 public:
  /// @param own     file of the text before the first `=== NAME`
  /// @param others  names that may follow; a file of another name is left out
  InputFiles(std::string_view input, std::string_view own,
             std::initializer_list<std::string_view> others = {});
  ~InputFiles();
  InputFiles(const InputFiles&) = delete;
  InputFiles& operator=(const InputFiles&) = delete;

  std::filesystem::path operator[](std::string_view name) const { return folder() / name; }
  /// In $TMPDIR, the process's own; empty but for the input's files.
  static const std::filesystem::path& folder();

 private:
  void write(std::string_view name, std::string_view content);

  std::vector<std::filesystem::path> written_;
};

}  // namespace diffnea::fuzz
