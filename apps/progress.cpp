#include "progress.hpp"

#include <csignal>
#include <cstdio>
#include <unistd.h>

namespace diffnea::apps {
namespace {

volatile std::sig_atomic_t interrupt_requested = 0;

extern "C" void on_interrupt(int) { interrupt_requested = 1; }

void install(void (*handler)(int), int flags) {
  struct sigaction action = {};
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace

Interruptible::Interruptible() {
  interrupt_requested = 0;
  install(on_interrupt, static_cast<int>(SA_RESETHAND));
}

Interruptible::~Interruptible() { install(SIG_DFL, 0); }

bool Interruptible::requested() { return interrupt_requested != 0; }

ProgressLine::ProgressLine(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

void ProgressLine::show(const FitProgress& progress) {
  if (quiet_) return;
  const Clock::time_point now = Clock::now();
  const bool new_stage = progress.stage != stage_;
  const auto pause = std::chrono::milliseconds(terminal_ ? 100 : 10'000);
  if (now - last_ < pause && (terminal_ || !new_stage)) return;
  stage_ = progress.stage;
  last_ = now;
  std::string text = progress.stage;
  if (progress.iteration > 0) text += ", pass " + std::to_string(progress.iteration + 1);
  if (progress.rows > 0) text += ": " + std::to_string(progress.rows) + " rows";
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::fprintf(stderr, terminal_ ? "\r\033[K%s, %.1f s" : "%s, %.1f s\n", text.c_str(), seconds);
  drawn_ = terminal_;
}

void ProgressLine::clear() {
  if (drawn_) std::fputs("\r\033[K", stderr);
  drawn_ = false;
}

}  // namespace diffnea::apps
