#include "progress.hpp"

#include <csignal>
#include <cstdio>
#include <cstring>
#include <unistd.h>

namespace diffnea::apps {
namespace {

volatile std::sig_atomic_t interrupt_requested = 0;

/// What the second signal removes: each path ends with '\0'. A handler may not allocate, so that it
/// was laid out before.
std::string* paths_to_remove = nullptr;

void install(void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

extern "C" void on_interrupt(int signal) {
  if (interrupt_requested == 0) {
    interrupt_requested = 1;
    return;
  }
  const char* const end = paths_to_remove->data() + paths_to_remove->size();
  for (const char* path = paths_to_remove->data(); path < end; path += std::strlen(path) + 1)
    if (unlink(path) != 0) rmdir(path);
  install(SIG_DFL);
  raise(signal);  // is taken when this function returns
}

}  // namespace

Interruptible::Interruptible(const std::vector<std::filesystem::path>& leftovers) {
  static std::string paths;
  paths.clear();
  for (const std::filesystem::path& path : leftovers) {
    paths += path.string();
    paths += '\0';
  }
  paths_to_remove = &paths;
  interrupt_requested = 0;
  install(on_interrupt);
}

Interruptible::~Interruptible() { install(SIG_DFL); }

bool Interruptible::requested() { return interrupt_requested != 0; }

ProgressLine::ProgressLine(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

void ProgressLine::show(const FitProgress& progress) {
  std::string detail;
  if (progress.iteration > 0) detail += ", pass " + std::to_string(progress.iteration + 1);
  if (progress.rows > 0) detail += ": " + std::to_string(progress.rows) + " rows";
  show(progress.stage, detail);
}

void ProgressLine::show(const std::string& stage, const std::string& detail) {
  if (quiet_) return;
  const Clock::time_point now = Clock::now();
  const bool new_stage = stage != stage_;
  const auto pause = std::chrono::milliseconds(terminal_ ? 100 : 10'000);
  if (now - last_ < pause && (terminal_ || !new_stage)) return;
  stage_ = stage;
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::fprintf(stderr, terminal_ ? "\r\033[K%s%s, %.1f s" : "%s%s, %.1f s\n", stage.c_str(),
               detail.c_str(), seconds);
  drawn_ = terminal_;
}

void ProgressLine::clear() {
  if (drawn_) std::fputs("\r\033[K", stderr);
  drawn_ = false;
}

}  // namespace diffnea::apps
