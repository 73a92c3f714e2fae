#pragma once
/// Processes that are gone.

#include <stdexcept>
#include <sys/wait.h>
#include <unistd.h>

namespace diffnea::test {

/// A number that no process has: of one that has ended, and was waited for.
inline pid_t ended_process() {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  if (child < 0) throw std::runtime_error("cannot fork");
  ::waitpid(child, nullptr, 0);
  return child;
}

}  // namespace diffnea::test
