#include "completion.hpp"

#include <algorithm>

namespace diffnea::apps {
namespace {

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
  CommandWords out{name, {}, {}};
  for (const CLI::Option* option : command.get_options()) {
    const OptionWords words = words_of(*option);
    (words.names.empty() ? out.places : out.options).push_back(words);
  }
  return out;
}

std::string join(const std::vector<std::string>& words, const char* between) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : between) + word;
  return out;
}

/// In single quotes.
std::string shell_quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// Argument of bash's function below: `@files`, `@number`, or the choices; nothing for a flag.
std::string bash_value(const OptionWords& option) {
  switch (option.value) {
    case Value::kNone:
      return "";
    case Value::kFile:
      return "@files";
    case Value::kNumber:
      return "@number";
    case Value::kChoice:
      break;
  }
  return join(option.choices, " ");
}

constexpr const char* kBashFunction = R"(
_diffnea() {
  local current=${COMP_WORDS[COMP_CWORD]} command= option= value= word i
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${COMP_WORDS[i]}
    if [[ $word == -* ]]; then option=$word
    elif [[ $word == '=' ]]; then continue
    elif [[ -z $command && -z $option ]]; then command=$word
    elif [[ -n $option && $(_diffnea_many "$command" "$option") != yes ]]; then option=
    fi
  done
  if [[ $current == '=' ]]; then current=; fi
  if [[ -n $option ]]; then value=$(_diffnea_value "$command" "$option"); fi
  if [[ $current == -* ]]; then value=$(_diffnea_options "$command")
  elif [[ -z $value && -z $command ]]; then value=$(_diffnea_options "" commands)
  elif [[ -z $value ]]; then value=$(_diffnea_value "$command" "")
  fi
  local IFS=$'\n'
  case $value in
    @files) compopt -o filenames 2>/dev/null; COMPREPLY=($(compgen -f -- "$current")) ;;
    @number | '') ;;
    *) IFS=$' \n'; COMPREPLY=($(compgen -W "$value" -- "$current")) ;;
  esac
}
complete -F _diffnea diffnea
)";

}  // namespace

std::vector<CommandWords> words_of(const CLI::App& app) {
  std::vector<CommandWords> out{words_of_command(app, "")};
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    out.push_back(words_of_command(*command, command->get_name()));
  return out;
}

std::string bash_completion(const std::vector<CommandWords>& commands) {
  std::string names, options, values, many;
  for (const CommandWords& c : commands) {
    if (!c.name.empty()) names += (names.empty() ? "" : " ") + c.name;
    std::string all;
    for (const OptionWords& o : c.options) {
      all += (all.empty() ? "" : " ") + join(o.names, " ");
      if (o.value == Value::kNone) continue;
      std::string cases;
      for (const std::string& name : o.names)
        cases += (cases.empty() ? "" : " | ") + shell_quoted(c.name + " " + name);
      values += "    " + cases + ") echo " + shell_quoted(bash_value(o)) + " ;;\n";
      if (o.many) many += "    " + cases + ") echo yes ;;\n";
    }
    if (!c.places.empty())
      values += "    " + shell_quoted(c.name + " ") + ") echo " +
                shell_quoted(bash_value(c.places.back())) + " ;;\n";
    options += "    " + shell_quoted(c.name + " ") + ") echo " + shell_quoted(all) + " ;;\n";
  }
  options += "    ' commands') echo " + shell_quoted(names) + " ;;\n";
  const auto function = [](const char* name, const char* what, const std::string& cases) {
    return std::string("# ") + what + "\n" + name + "() {\n  case \"$1 $2\" in\n" + cases +
           "  esac\n}\n";
  };
  return "# Completion of diffnea in bash, written by `diffnea completion bash`.\n" +
         function("_diffnea_options", "Options of command $1.", options) +
         function("_diffnea_value", "What may follow option $2 of command $1.", values) +
         function("_diffnea_many", "Whether option $2 of command $1 takes several values.", many) +
         kBashFunction;
}

}  // namespace diffnea::apps
