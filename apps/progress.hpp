#pragma once
/// Progress of long work on standard error, and Ctrl-C.

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/identify/identify.hpp>

namespace diffnea::apps {

/// While it lives, the first SIGINT or SIGTERM sets a flag; the second ends the program.
class Interruptible {
 public:
  /// @param leftovers  files and folders that go before the second signal ends the program, in
  /// order
  explicit Interruptible(const std::vector<std::filesystem::path>& leftovers = {});
  ~Interruptible();
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;
  static bool requested();
};

/// On a terminal one line that is rewritten, else a line for every stage and every ten seconds.
class ProgressLine {
 public:
  explicit ProgressLine(bool quiet);
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void show(const FitProgress& progress);
  /// @param stage  what is done; @param detail  how far it is
  void show(const std::string& stage, const std::string& detail);
  /// Leaves the terminal's line empty.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;
  bool quiet_, terminal_, drawn_ = false;
  std::string stage_;
  Clock::time_point start_ = Clock::now(), last_;
};

}  // namespace diffnea::apps
