#pragma once
/// RUN/: results appear in it complete, or not at all.
///
///     ResultFolder folder("run");  // fails now, not after an hour's work
///     write_file_atomically(folder.staging() / "result.json", text);
///     folder.publish({"result.json"});

#include <filesystem>
#include <string>
#include <vector>

namespace diffnea {

/// A folder of results that appears whole, or not at all.
class ResultFolder {
 public:
  /// Creates the folder, if it is not there, and a hidden one in it that collects the files. Those
  /// that killed programs left there go.
  /// @throws FileError with the system's reason
  explicit ResultFolder(const std::filesystem::path& path);
  /// Unpublished files vanish, and so does the folder if it was created here and is empty.
  ~ResultFolder();
  ResultFolder(const ResultFolder&) = delete;
  ResultFolder& operator=(const ResultFolder&) = delete;

  /// Where the result will be.
  const std::filesystem::path& path() const { return path_; }
  /// Where it is made.
  const std::filesystem::path& staging() const { return staging_; }

  /// What would remain if the program were killed now, in the order in which it can be removed.
  /// @param names  files that a run of this kind may have
  std::vector<std::filesystem::path> leftovers(const std::vector<std::string>& names) const;

  /// Moves the collected files into the folder; what an earlier run left under one of `names` goes.
  /// result.json is removed first and comes last: where it is, the rest belongs to it.
  /// @param names  files that a run of this kind may have
  /// @throws FileError
  void publish(const std::vector<std::string>& names);
  /// What publish() has moved there, result.json first.
  const std::vector<std::string>& files() const { return files_; }

 private:
  std::filesystem::path path_, staging_;
  std::vector<std::filesystem::path> created_;  ///< folders that were not there, outermost first
  std::vector<std::string> files_;              ///< those published
  bool published_ = false;
};

}  // namespace diffnea
