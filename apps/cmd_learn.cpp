
#include <diffnea/runs/ball_network_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/worlds/world.hpp>
#include <diffnea/report/learn_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/version.hpp>

#include "common.hpp"
#include "outputs.hpp"
#include "policies.hpp"

namespace diffnea::apps {
namespace {

struct LearnCommand {
  CommonOptions common;
  std::vector<std::string> command_line;
  std::string task, model, controller, ball_network, out;
  PolicyOptions policies;
};

void run_learn(const LearnCommand& c) {
  const std::vector<std::string> kinds{".xml", ".json", ".urdf"};
  const auto file = find_model_file(c.model, kinds);
  const auto controller_file = c.controller.empty() ? file : find_model_file(c.controller, kinds);
  PolicyOptions policies = c.policies;
  if (!c.ball_network.empty())
    policies.learn.simulator.ball_network = read_ball_network(c.ball_network);
  const BallInCup task = task_of(read_model(file), read_model(controller_file), policies);
  check_run_folder(c.out, "learn");
  ResultFolder folder(c.out);
  const Interruptible interruptible(folder.leftovers(kRunFiles));
  ProgressLine line(c.common.quiet);
  LearnRun run = learn_with_checkpoints(task, policies, c.common, folder.path(), line);
  run.reproduce.version = version();
  run.reproduce.command = c.command_line;
  run.reproduce.inputs.push_back(describe_input("model", file));
  if (!c.controller.empty())
    run.reproduce.inputs.push_back(describe_input("controller", controller_file));
  if (!c.ball_network.empty())
    run.reproduce.inputs.push_back(describe_input("ball_network", c.ball_network));
  if (run.policies.empty())
    stop(kInterrupted, "interrupted before anything was learned; nothing was written");
  publish_learn_run(run, folder);
  line.clear();
  show_result(c.common.json ? learn_result_json(run) : learn_text(run), folder, c.common);
  if (run.interrupted)
    stop(kInterrupted,
         "interrupted: the policies are what had been learned until then; the same command goes on "
         "from there");
  if (const std::string why = why_not_usable(run); !why.empty()) stop(kNoUsableResult, why);
}

}  // namespace

void add_learn(CLI::App& app, const std::vector<std::string>& command_line) {
  auto c = std::make_shared<LearnCommand>();
  c->command_line = command_line;
  CLI::App* command = app.add_subcommand(
      "learn",
      "Learn a task in a model, offline: eREPS over the weights of a movement primitive.\n"
      "Killed or interrupted, the same command goes on from the last iteration.");
  command->add_option("task", c->task, "ball-in-cup")
      ->required()
      ->check(CLI::IsMember({"ball-in-cup"}));
  command
      ->add_option(
          "model", c->model,
          "robot with a ball on a string and a cup: the model.json of `identify`, an MJCF, "
          "or the name of a model that comes with diffnea (wam4_ball_in_cup)")
      ->required();
  command->add_option("-o,--output", c->out, "folder for policies and page")->required();
  command->add_option("--controller", c->controller,
                      "description that the robot's controller compensates gravity with; default: "
                      "the model");
  command
      ->add_option("--ball-network", c->ball_network,
                   "network that moves the ball in place of string and gravity "
                   "(diffnea.blackbox.train, .json): a black-box baseline")
      ->check(CLI::ExistingFile);
  add_policy_options(*command, c->policies);
  add_common(*command, c->common);
  command->callback([c] { run_learn(*c); });
}

}  // namespace diffnea::apps
