#include <cstdio>

#include "common.hpp"
#include "completion.hpp"

namespace diffnea::apps {
namespace {

void run_completion(const CLI::App& app) {
  std::fputs(bash_completion(words_of(app)).c_str(), stdout);
}

}  // namespace

void add_completion(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "completion",
      "Print what makes a shell complete commands, options, their choices and files.\n"
      "  for good: diffnea completion bash > ~/.local/share/bash-completion/completions/diffnea\n"
      "  in the shell at hand: source <(diffnea completion bash)");
  command->add_option("shell", "whose")
      ->type_name("TEXT")
      ->required()
      ->check(CLI::IsMember({"bash"}));
  command->callback([&app] { run_completion(app); });
}

}  // namespace diffnea::apps
