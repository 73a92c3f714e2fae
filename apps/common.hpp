#pragma once
/// What every command shares. A command is one file: its options, add_<name> that declares them,
/// and run_<name> that calls the library.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace diffnea::apps {

/// Exit statuses of the contract; 0 is done, whatever the verdict.
enum ExitStatus { kBadInput = 1, kWrongUsage = 2, kNoUsableResult = 3, kInterrupted = 130 };

/// The options that every command takes.
struct CommonOptions {
  bool json = false;       ///< the machine-readable result on standard output, nothing else
  bool quiet = false;      ///< no progress on standard error
  std::uint64_t seed = 0;  ///< of everything that is drawn by chance
  int threads = 0;         ///< 0: as many as there are cores
};

/// Adds --json, --quiet, --seed and --threads to a command.
inline void add_common(CLI::App& command, CommonOptions& options) {
  command.add_flag("--json", options.json, "print the result as JSON on standard output");
  command.add_flag("--quiet", options.quiet, "print no progress");
  command.add_option("--seed", options.seed, "seed of random numbers")->capture_default_str();
  command.add_option("--threads", options.threads, "threads, 0: one a core")->capture_default_str();
}

void add_audit(CLI::App& app);
void add_compare(CLI::App& app);
void add_excite(CLI::App& app);
/// @param command_line  as it was typed, for the result
void add_identify(CLI::App& app, const std::vector<std::string>& command_line);
void add_info(CLI::App& app);
void add_report(CLI::App& app);
void add_simulate(CLI::App& app);
void add_worlds(CLI::App& app);

}  // namespace diffnea::apps
