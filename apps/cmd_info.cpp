#include <cstdio>

#include <diffnea/io/model_file.hpp>
#include <diffnea/io/model_info.hpp>

#include "common.hpp"
#include "options.hpp"
#include "recordings.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

struct InfoOptions {
  CommonOptions common;
  ModelReading reading;
  std::string model;
  JointChoice choice;
};

void run_info(const InfoOptions& options) {
  ServedModel served = serve_joints(read_model(options.model, options.reading),
                                    std::vector<std::string>{}, options.choice);
  Model& model = served.model;
  if (!served.note.empty()) model.notes.push_back(served.note);
  const std::string text = options.common.json ? model_info_json(model) : model_info_text(model);
  std::fwrite(text.data(), 1, text.size(), stdout);
}

}  // namespace

void add_info(CLI::App& app) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command = app.add_subcommand(
      "info", "Show a robot description as it is understood, and what looks wrong with it.");
  add_robot(*command, options->model);
  add_options(*command, options->reading);
  add_joint_options(*command, options->choice);
  add_common(*command, options->common);
  command->callback([options] { run_info(*options); });
}

}  // namespace diffnea::apps
