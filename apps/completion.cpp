#include "completion.hpp"

#include <algorithm>

namespace diffnea::apps {
namespace {

/// Up to the end of the first sentence or line, in a length that a terminal shows.
std::string first_sentence(const std::string& text) {
  constexpr std::size_t kLongest = 70;
  std::string out = text.substr(0, std::min({text.find('\n'), text.find(". "), text.find(';')}));
  while (out.ends_with('.')) out.pop_back();
  if (out.size() <= kLongest) return out;
  return out.substr(0, out.rfind(' ', kLongest)) + " ...";
}

/// CLI11 writes what a value must be as "TEXT:{motor,link}".
std::vector<std::string> choices_in(const std::string& type) {
  std::vector<std::string> out;
  const std::size_t open = type.find('{'), close = type.find('}', open);
  if (open == std::string::npos || close == std::string::npos) return out;
  std::size_t begin = open + 1;
  while (begin <= close) {
    const std::size_t end = std::min(type.find(',', begin), close);
    if (end > begin) out.push_back(type.substr(begin, end - begin));
    begin = end + 1;
  }
  return out;
}

OptionWords words_of(const CLI::Option& option) {
  OptionWords out;
  for (const std::string& name : option.get_snames()) out.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) out.names.push_back("--" + name);
  out.help = first_sentence(option.get_description());
  if (option.get_items_expected_max() == 0) return out;  // a flag
  const std::string type = option.get_type_name();
  out.many = option.get_items_expected_max() > 1;
  out.choices = choices_in(type);
  out.value = !out.choices.empty()       ? Value::kChoice
              : type.starts_with("TEXT") ? Value::kFile
                                         : Value::kNumber;
  return out;
}

CommandWords words_of_command(const CLI::App& command, const std::string& name) {
  CommandWords out{name, first_sentence(command.get_description()), {}, {}};
  for (const CLI::Option* option : command.get_options()) {
    const OptionWords words = words_of(*option);
    (words.names.empty() ? out.places : out.options).push_back(words);
  }
  return out;
}

}  // namespace

std::vector<CommandWords> words_of(const CLI::App& app) {
  std::vector<CommandWords> out{words_of_command(app, "")};
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    out.push_back(words_of_command(*command, command->get_name()));
  return out;
}

}  // namespace diffnea::apps
