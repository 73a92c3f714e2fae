#include "completion.hpp"

namespace diffnea::apps {
namespace {

std::string join(const std::vector<std::string>& words, const char* between) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : between) + word;
  return out;
}

/// In single quotes, for zsh and bash.
std::string shell_quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string fish_quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text)
    out += c == '\'' || c == '\\' ? std::string{'\\', c} : std::string(1, c);
  return out + "'";
}

/// Brackets and colons part the fields of zsh's specifications.
std::string zsh_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_value(const OptionWords& option) {
  switch (option.value) {
    case Value::kNone:
      return "";
    case Value::kFile:
      return ":file:_files";
    case Value::kNumber:
      return ":number: ";
    case Value::kChoice:
      break;
  }
  return ":choice:(" + join(option.choices, " ") + ")";
}

/// What bash's function below takes: `@files`, `@number`, or the choices; nothing for a flag.
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

std::string zsh_completion(const std::vector<CommandWords>& commands) {
  std::string described, cases;
  const auto specifications = [](const CommandWords& c) {
    std::string out;
    for (const OptionWords& o : c.options) {
      const std::string help = "[" + zsh_text(o.help) + "]", value = zsh_value(o);
      for (const std::string& name : o.names)
        out += " \\\n        " + shell_quoted((o.many ? "*" : "") + name + help + value);
    }
    for (const OptionWords& o : c.places)
      out += " \\\n        " + shell_quoted((o.many ? "*" : "") + zsh_value(o));
    return out;
  };
  for (const CommandWords& c : commands) {
    if (c.name.empty()) continue;
    described += "    " + shell_quoted(c.name + ":" + zsh_text(c.help)) + "\n";
    cases += "    " + c.name + ")\n      _arguments" + specifications(c) + "\n      ;;\n";
  }
  return "#compdef diffnea\n"
         "# Completion of diffnea in zsh, written by `diffnea completion zsh`.\n"
         "_diffnea() {\n"
         "  local -a commands=(\n" +
         described +
         "  )\n"
         "  if (( CURRENT == 2 )); then\n"
         "    if [[ $words[2] == -* ]]; then\n"
         "      _arguments" +
         specifications(commands.front()) +
         "\n"
         "    else\n"
         "      _describe command commands\n"
         "    fi\n"
         "    return\n"
         "  fi\n"
         "  local command=$words[2]\n"
         "  shift words\n"
         "  (( CURRENT-- ))\n"
         "  case $command in\n" +
         cases +
         "  esac\n"
         "}\n"
         "if [[ $funcstack[1] == _diffnea ]]; then _diffnea \"$@\"; else compdef _diffnea diffnea; "
         "fi\n";
}

std::string fish_completion(const std::vector<CommandWords>& commands) {
  std::string out =
      "# Completion of diffnea in fish, written by `diffnea completion fish`.\n"
      "complete -c diffnea -f\n";
  const auto line = [&](const std::string& when, const OptionWords& o) {
    out += "complete -c diffnea -n " + fish_quoted(when);
    for (const std::string& name : o.names)
      out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    if (o.value == Value::kFile) out += o.names.empty() ? " -F" : " -r -F";
    if (o.value == Value::kNumber) out += " -x";
    if (o.value == Value::kChoice)
      out += (o.names.empty() ? " -a " : " -x -a ") + fish_quoted(join(o.choices, " "));
    out += " -d " + fish_quoted(o.help) + "\n";
  };
  for (const CommandWords& c : commands) {
    const std::string when = c.name.empty() ? std::string("__fish_use_subcommand")
                                            : "__fish_seen_subcommand_from " + c.name;
    if (!c.name.empty())
      out += "complete -c diffnea -n __fish_use_subcommand -a " + c.name + " -d " +
             fish_quoted(c.help) + "\n";
    for (const OptionWords& o : c.options) line(when, o);
    for (const OptionWords& o : c.places) line(when, o);
  }
  return out;
}

}  // namespace diffnea::apps
