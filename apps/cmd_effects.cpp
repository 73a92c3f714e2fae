#include <cstdio>

#include <diffnea/io/effects_list.hpp>

#include "common.hpp"

namespace diffnea::apps {

void add_effects(CLI::App& app) {
  auto options = std::make_shared<CommonOptions>();
  CLI::App* command = app.add_subcommand(
      "effects", "List the effects there are: formulas, places, parameters, units.");
  add_common(*command, *options);
  command->callback(
      [options] { std::fputs((options->json ? effects_json() : effects_text()).c_str(), stdout); });
}

}  // namespace diffnea::apps
