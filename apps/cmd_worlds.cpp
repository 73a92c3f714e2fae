#include <cstdio>

#include <diffnea/worlds/world.hpp>

#include "common.hpp"

namespace diffnea::apps {

void add_worlds(CLI::App& app) {
  auto options = std::make_shared<CommonOptions>();
  CLI::App* command = app.add_subcommand("worlds", "List the worlds there are, and their keys.");
  add_common(*command, *options);
  command->callback(
      [options] { std::fputs((options->json ? worlds_json() : worlds_text()).c_str(), stdout); });
}

}  // namespace diffnea::apps
