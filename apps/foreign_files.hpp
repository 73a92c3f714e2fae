#pragma once
/// Recordings that are no CSV: Python's package `diffnea` turns them into columns, the command
/// reads those as it reads CSV.

#include <filesystem>
#include <string>
#include <vector>

namespace diffnea::apps {

/// Topics and clock of a ROS bag.
struct BagOptions {
  std::string topic, command_topic, clock;
};

/// A file as columns.
struct ColumnsOfFile {
  std::filesystem::path path;      ///< CSV
  std::vector<std::string> notes;  ///< of the reader, one sentence each
};

/// A folder for the columns of foreign files, which goes with it.
class ForeignFiles {
 public:
  ForeignFiles() = default;
  ~ForeignFiles();
  ForeignFiles(const ForeignFiles&) = delete;
  ForeignFiles& operator=(const ForeignFiles&) = delete;

  /// @param kind  as foreign_kind has it
  /// @throws FileError in the words of Python's reader; or, where no Python has the package, with
  ///         what to install
  ColumnsOfFile read(const std::filesystem::path& file, const std::string& kind,
                     const BagOptions& bag);

 private:
  std::filesystem::path folder_;
  std::string python_;
  int count_ = 0;
};

}  // namespace diffnea::apps
