#pragma once
/// Completion in bash: what there is to complete, read off the declared commands, and the script
/// that tells it to the shell. Nothing is listed by hand, so nothing goes stale.

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace diffnea::apps {

/// What may stand behind an option, or at a place without one.
enum class Value { kNone, kFile, kNumber, kChoice };

struct OptionWords {
  std::vector<std::string> names;  ///< "-o", "--output"; empty: a place, not an option
  Value value = Value::kNone;
  bool many = false;                 ///< takes several values
  std::vector<std::string> choices;  ///< of Value::kChoice
};

struct CommandWords {
  std::string name;  ///< empty: the program itself
  std::vector<OptionWords> options, places;
};

/// The program's own options, then every command.
std::vector<CommandWords> words_of(const CLI::App& app);

std::string bash_completion(const std::vector<CommandWords>& commands);

}  // namespace diffnea::apps
