#include <chrono>
#include <cstdio>

#include <diffnea/runs/policy_result.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/report/transfer_text.hpp>
#include <diffnea/version.hpp>

#include "common.hpp"
#include "outputs.hpp"
#include "policies.hpp"
#include "transfers.hpp"

namespace diffnea::apps {
namespace {

struct TransferCommand {
  CommonOptions common;
  std::vector<std::string> command_line;
  std::string policies, out;
  TransferOptions options;
};

/// What is of the world's sensors acts on recordings alone.
void refuse_without_effect(const TransferOptions& options) {
  if (options.record) return;
  const WorldSpec world = world_of(options), plain;
  if (world.noise != plain.noise || world.repetitions != plain.repetitions)
    throw CLI::ValidationError("--world",
                               std::string(world.noise != plain.noise ? "noise" : "repetitions") +
                                   " is of recordings, which only --record makes; executions have "
                                   "--repetitions, --torque-noise and --posture-noise");
}

void run_transfer(const TransferCommand& c) {
  refuse_without_effect(c.options);
  const LearnRun learned = read_learn_run(c.policies);
  check_run_folder(c.out, "transfer");
  ResultFolder folder(c.out);
  const Interruptible interruptible(folder.leftovers(kRunFiles));
  ProgressLine line(c.common.quiet);
  TransferOptions options = c.options;
  if (const double nominal = learned.task.options.nominal_string; nominal > 0.0 && !options.string)
    options.string = nominal;
  TransferRun run = transfer_policies(learned, options, c.common, line);
  run.reproduce.version = version();
  run.reproduce.command = c.command_line;
  run.reproduce.inputs.push_back(
      describe_input("policies", std::filesystem::path(c.policies) / "result.json"));
  if (run.executions.empty())
    stop(kInterrupted, "interrupted before anything was executed; nothing was written");
  std::string lost;
  if (options.record && !run.interrupted)
    lost = record_policies(run, options, c.common, folder.staging(), line);
  publish_transfer_run(run, folder);
  line.clear();
  show_result(c.common.json ? transfer_result_json(run) : transfer_text(run), folder, c.common);
  std::fputs(lost.c_str(), stderr);
  if (run.interrupted)
    stop(kInterrupted, "interrupted: the result is of what had been executed until then");
  if (run.best < 0) stop(kNoUsableResult, "no policy could be executed: all of them failed");
  if (!lost.empty()) throw CLI::RuntimeError(kNoUsableResult);
}

}  // namespace

void add_transfer(CLI::App& app, const std::vector<std::string>& command_line) {
  auto c = std::make_shared<TransferCommand>();
  c->command_line = command_line;
  CLI::App* command = app.add_subcommand(
      "transfer",
      "Execute learned policies in a world that is not the model they were learned in.\n"
      "Every policy once, without noise; the best of them again with the noise of drives, encoders "
      "and posture. Success is a ball that is in the cup throughout the last half second.");
  command->add_option("policies", c->policies, "folder that `learn` left")->required();
  command->add_option("-o,--output", c->out, "folder for the result and the page")->required();
  add_transfer_options(*command, c->options);
  add_common(*command, c->common);
  command->callback([c] { run_transfer(*c); });
}

}  // namespace diffnea::apps
