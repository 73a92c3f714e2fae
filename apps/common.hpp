#pragma once
/// What every command shares. A command is one file: its options, add_<name> that declares them,
/// and run_<name> that calls the library.

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/scalar.hpp>

namespace diffnea::apps {

/// Exit statuses of the contract; 0 is done, whatever the verdict.
enum ExitStatus { kBadInput = 1, kWrongUsage = 2, kNoUsableResult = 3, kInterrupted = 130 };

/// The options that every command takes.
struct CommonOptions {
  bool json = false;       ///< the machine-readable result on standard output, nothing else
  bool quiet = false;      ///< no progress, nor which files were written
  std::uint64_t seed = 0;  ///< of everything that is drawn by chance
  int threads = 0;         ///< 0: as many as there are cores
};

/// Threads that the options ask for.
inline int threads_of(const CommonOptions& options) {
  return options.threads > 0 ? options.threads
                             : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

/// Numbers of an option as a vector.
inline VecX<double> vector_of(const std::vector<double>& values) {
  return Eigen::Map<const VecX<double>>(values.data(), static_cast<long>(values.size()));
}

/// A finite number, `low` or more; above it, if `strictly`.
inline CLI::Validator at_least(double low, bool strictly = false) {
  const auto bound = [low, strictly] {
    char text[40];
    std::snprintf(text, sizeof text, strictly ? "above %g" : "%g or more", low);
    return std::string(text);
  };
  return CLI::Validator(
      [=](const std::string& text) {
        double x = 0.0;
        const bool is_number = CLI::detail::lexical_cast(text, x) && std::isfinite(x);
        return is_number && (strictly ? x > low : x >= low)
                   ? std::string()
                   : "got " + text + ", expected a number, " + bound();
      },
      bound());
}

/// A number from `low` to `high`. (CLI11's own message has 6 digits of 1e-12, 309 of the largest.)
inline CLI::Validator in_range(double low, double high) {
  const auto bounds = [low, high] {
    char text[60];
    std::snprintf(text, sizeof text, "%g to %g", low, high);
    return std::string(text);
  };
  return CLI::Validator(
      [=](const std::string& text) {
        double x = 0.0;
        return CLI::detail::lexical_cast(text, x) && x >= low && x <= high
                   ? std::string()
                   : "got " + text + ", expected a number from " + bounds();
      },
      bounds());
}

/// An integer from 0 to `most`. (CLI11 would take -1 as 2^64 − 1.)
inline CLI::Validator count(std::uint64_t most) {
  return CLI::Validator(
      [=](const std::string& text) {
        std::uint64_t x = 0;
        const auto [last, error] = std::from_chars(text.data(), text.data() + text.size(), x);
        return error == std::errc() && last == text.data() + text.size() && x <= most
                   ? std::string()
                   : "got " + text + ", expected an integer from 0 to " + std::to_string(most);
      },
      "");
}

/// Adds --json, --quiet, --seed and --threads to a command.
inline void add_common(CLI::App& command, CommonOptions& options) {
  command.add_flag("--json", options.json, "print the result as JSON on standard output");
  command.add_flag("--quiet", options.quiet, "print no progress, and not which files were written");
  command.add_option("--seed", options.seed, "seed of random numbers")
      ->check(count(std::numeric_limits<std::uint64_t>::max()))
      ->capture_default_str();
  command.add_option("--threads", options.threads, "threads, 0: one a core")
      ->check(count(4096))
      ->capture_default_str();
}

void add_audit(CLI::App& app);
void add_compare(CLI::App& app);
/// @param app  also what the scripts are made of, once all commands are there
void add_completion(CLI::App& app);
/// @param command_line  as it was typed, for the result
void add_diagnose(CLI::App& app, const std::vector<std::string>& command_line);
void add_effects(CLI::App& app);
void add_excite(CLI::App& app);
/// @param command_line  as it was typed, for the result
void add_experiment(CLI::App& app, const std::vector<std::string>& command_line);
/// @param command_line  as it was typed, for the result
void add_identify(CLI::App& app, const std::vector<std::string>& command_line);
void add_export(CLI::App& app);
void add_info(CLI::App& app);
/// @param command_line  as it was typed, for the result
void add_learn(CLI::App& app, const std::vector<std::string>& command_line);
void add_report(CLI::App& app);
void add_simulate(CLI::App& app);
/// @param command_line  as it was typed, for the result
void add_transfer(CLI::App& app, const std::vector<std::string>& command_line);
void add_worlds(CLI::App& app);

}  // namespace diffnea::apps
