#include <cstdio>
#include <utility>

#include <diffnea/io/model_file.hpp>
#include <diffnea/model/graft.hpp>
#include <diffnea/runs/export_result.hpp>

#include "common.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

struct ExportCommand {
  CommonOptions common;
  ModelReading reading;
  ModelWriting writing;
  std::string model, into, out;
};

void run_export(const ExportCommand& c) {
  check_output(c.out, {c.model});
  Model model = read_model_or_run(c.model, c.reading);
  check_output(c.out, {model.source});
  std::vector<std::string> left_out;
  if (!c.into.empty()) {
    check_output(c.out, {c.into});
    Model whole = read_model(c.into, c.reading);
    left_out = graft(whole, model);
    model = std::move(whole);
  }
  for (const std::string& what : write_model(model, c.out, c.reading, c.writing))
    left_out.push_back(what);
  if (c.common.json) {
    std::fputs(export_result_json(c.model, c.out, left_out).c_str(), stdout);
    return;
  }
  if (!left_out.empty()) std::fprintf(stderr, "%s cannot hold:\n", c.out.c_str());
  for (const std::string& what : left_out) std::fprintf(stderr, "  %s\n", what.c_str());
  if (!c.common.quiet) std::printf("%s\n", c.out.c_str());
}

}  // namespace

void add_export(CLI::App& app) {
  auto c = std::make_shared<ExportCommand>();
  CLI::App* command = app.add_subcommand(
      "export",
      "Write a model, or what a run fitted, as URDF, MJCF or JSON.\n"
      "A model that came in the form it is exported to keeps its document, with the values put in\n"
      "place; another is drawn anew, without looks. URDF holds inertias, limits, damping and\n"
      "friction; MJCF also rotor inertias, springs, passive joints, frames, gravity and a ball.\n"
      "What the format cannot hold is listed on standard error, and in --json.");
  command
      ->add_option("model", c->model,
                   "robot description: URDF, MJCF or JSON; or the name of one that comes along; or "
                   "the folder of a run: the model that it fitted or extended")
      ->required()
      ->transform(robot_file);
  command->add_option("-o,--output", c->out, "file to write: .urdf, .xml (MJCF) or .json")
      ->required();
  command
      ->add_option("--into", c->into,
                   "description of the whole robot, where the model is a part of it whose other "
                   "joints were locked: of what moves there, by name, it takes the values, and is "
                   "what is written")
      ->transform(robot_file);
  command
      ->add_option("--mujoco", c->writing.mujoco,
                   "oldest MuJoCo that has to load an MJCF: 2.2, or 3.5, whose actuators have a "
                   "delay")
      ->capture_default_str();
  add_options(*command, c->reading);
  add_common(*command, c->common);
  command->callback([c] { run_export(*c); });
}

}  // namespace diffnea::apps
