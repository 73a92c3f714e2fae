#include <cstdio>

#include "common.hpp"
#include "completion.hpp"

namespace diffnea::apps {
namespace {

void run_completion(const CLI::App& app, const std::string& shell) {
  const std::vector<CommandWords> words = words_of(app);
  const std::string script = shell == "bash"  ? bash_completion(words)
                             : shell == "zsh" ? zsh_completion(words)
                                              : fish_completion(words);
  std::fputs(script.c_str(), stdout);
}

}  // namespace

void add_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(
      "completion",
      "Print what makes a shell complete commands, options, their choices and files.\n"
      "  bash: diffnea completion bash > ~/.local/share/bash-completion/completions/diffnea\n"
      "  zsh:  diffnea completion zsh > \"${fpath[1]}/_diffnea\"\n"
      "  fish: diffnea completion fish > ~/.config/fish/completions/diffnea.fish\n"
      "In the shell at hand alone: source <(diffnea completion bash)");
  command->add_option("shell", *shell, "whose")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->callback([shell, &app] { run_completion(app, *shell); });
}

}  // namespace diffnea::apps
