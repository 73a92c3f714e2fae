#pragma once
/// Described options (diffnea/core/options.hpp) as those of a command.

#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <CLI/CLI.hpp>

#include <diffnea/core/fields.hpp>
#include <diffnea/core/options.hpp>

#include "common.hpp"

namespace diffnea::apps {

/// Adds options to a command, which writes into the struct that they are of.
class OptionAdder {
 public:
  explicit OptionAdder(CLI::App& command) : command_(command) {}

  void words(const char* name, const char*, const std::vector<std::string>& choices,
             const std::string& now, const std::function<void(const std::string&)>& set,
             const std::string& text) {
    command_.add_option_function<std::string>(name, set, text)
        ->check(CLI::IsMember(choices))
        ->default_str(now);
  }

  template <class F>
  void option(const char* name, const char* python, F& value, std::string text,
              OptionTraits traits = {}) {
    if (name == nullptr) return;
    constexpr bool is_list = std::is_same_v<F, std::vector<std::string>>;
    if constexpr (NamedEnum<F>) {
      words(
          name, python, names_of<F>(), name_of(value),
          [&value](const std::string& word) { value = value_of<F>(word, "option"); }, text);
    } else if constexpr (std::is_same_v<F, bool>) {
      const std::string flag = name;
      command_.add_flag(flag + ",!--no-" + flag.substr(2), value,
                        text + "; default: " + (value ? "yes" : "no"));
    } else if constexpr (std::is_same_v<F, std::optional<std::vector<std::string>>>) {
      command_
          .add_option_function<std::vector<std::string>>(
              name,
              [&value](const std::vector<std::string>& given) {
                value =
                    given == std::vector<std::string>{"none"} ? std::vector<std::string>{} : given;
              },
              text + "; separated by commas, or none")
          ->delimiter(',');
    } else {
      if (is_list && traits.by_commas) text += "; separated by commas";
      CLI::Option* option = command_.add_option(name, value, text);
      if (traits.by_commas) option->delimiter(',');
      if (std::isfinite(traits.least)) option->check(at_least(traits.least, traits.above));
      if constexpr (is_list) {
        if (value.empty()) return;
      }
      option->capture_default_str();
    }
  }

 private:
  CLI::App& command_;
};

/// Adds the options of a struct to a command. It has to outlive the command.
template <class Options>
void add_options(CLI::App& command, Options& options) {
  OptionAdder adder(command);
  options.options(adder);
}

}  // namespace diffnea::apps
