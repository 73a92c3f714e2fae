#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/report/identify_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/version.hpp>

#include "common.hpp"
#include "effect_names.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "recordings.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

/// The inertias are the model's then, to nine digits; beyond, squares of the strength drown the
/// data.
constexpr double kStrongestPrior = 1e9;

struct IdentifyCommand {
  CommonOptions common;
  ModelReading reading;
  std::vector<std::string> command_line;
  RecordingOptions recording;
  std::string model, out, prior = "none";
  std::vector<std::string> data, test;
  IdentifyOptions options;
};

/// An option that nothing would look at is a mistake of whoever gave it.
void refuse_without_effect(const IdentifyCommand& c, const CLI::App& command, const Model& model) {
  const auto refuse = [](const std::string& option, const std::string& why) {
    throw CLI::ValidationError(option, why);
  };
  const auto given = [&](const char* option) { return command.count(option) > 0; };
  const bool motion = c.options.loss == Loss::kMotion;
  const bool constrained = c.options.ball.loss == BallLoss::kConstrained;
  if (motion && c.options.robust != Robust::kNone)
    refuse("--robust", "the motion loss has no weights to lose; use --loss inverse or forward");
  if (motion && c.prior != "none")
    refuse("--prior", "the motion loss has none; use --loss inverse or forward");
  const bool virtual_ = c.options.linear.parameters == FitParameters::kVirtual;
  if (motion && virtual_)
    refuse("--parameters", "the motion loss has convex ones; use --loss inverse or forward");
  if (virtual_ && c.prior != "none")
    refuse("--parameters", "virtual parameters have no entropic prior; leave --prior out");
  if (!motion && given("--horizon"))
    refuse("--horizon", "is of --loss motion (of a ball: --ball-window)");
  if (!constrained && given("--lambda")) refuse("--lambda", "is of --loss constrained");
  if (model.ball) return;
  const std::string none = "is of a ball, and " + c.model + " has none";
  if (constrained) refuse("--loss constrained", none);
  if (given("--ball-window")) refuse("--ball-window", none);
}

void set_prior(const std::string& text, IdentifyOptions& options) {
  if (text == "none") return;
  double strength = 0.0;
  if (!text.starts_with("entropic=") || !CLI::detail::lexical_cast(text.substr(9), strength) ||
      !(strength >= 0.0 && strength <= kStrongestPrior))
    throw CLI::ValidationError("--prior", "got " + text +
                                              "; choices: none, entropic=STRENGTH with a STRENGTH "
                                              "from 0 to 1e9, e.g. entropic=0.1");
  options.linear.entropic_prior = strength;
}

void run_identify(IdentifyCommand c, const CLI::App& command) {
  refuse_repeated_files(c.data, c.test);
  c.recording.quiet = c.common.quiet;
  set_prior(c.prior, c.options);
  if (c.options.choice.effects) c.options.choice.effects = with_pairs(*c.options.choice.effects);
  c.options.motion.threads = threads_of(c.common);
  check_run_folder(c.out, "identify");
  Model model = read_model(c.model, c.reading);
  refuse_without_effect(c, command, model);
  ResultFolder folder(c.out);  // cannot be written: better known now

  const Interruptible interruptible(folder.leftovers(kRunFiles));
  ProgressLine line(c.common.quiet);
  c.options.progress = [&](const FitProgress& progress) {
    line.show(progress);
    return !Interruptible::requested();
  };
  FitRun run;
  run.reproduce.version = version();
  run.reproduce.command = c.command_line;
  try {
    line.show({"opening", 0, 0, 0.0});
    const RecordingFiles data(c.data, c.recording, line), held_out(c.test, c.recording, line);
    const std::string note = serve_joints_of(data, held_out, c.recording, model, line);
    const std::unique_ptr<RecordingSource> train = data.open(model);
    std::unique_ptr<RecordingSource> test;
    if (!c.test.empty()) test = held_out.open(model);
    run.fit = identify(model, *train, test.get(), c.options);
    if (!note.empty()) run.fit.notes.insert(run.fit.notes.begin(), note);
  } catch (const Error&) {
    if (!Interruptible::requested()) throw;
    line.clear();
    stop(kInterrupted, "interrupted before anything was fitted; nothing was written");
  }
  run.reproduce.inputs.push_back(describe_input("model", c.model));
  for (const std::string& file : c.data)
    run.reproduce.inputs.push_back(describe_input("data", file));
  for (const std::string& file : c.test)
    run.reproduce.inputs.push_back(describe_input("test", file));
  publish_fit_run(run, folder);
  line.clear();
  show_result(c.common.json ? identify_result_json(run) : identify_text(run), folder, c.common);
  if (run.fit.summary.interrupted)
    stop(kInterrupted, "interrupted: the result is of what had been done until then (" +
                           run.fit.summary.termination + ")");
  if (!run.fit.summary.converged)
    stop(kNoUsableResult, "no usable result: " + run.fit.summary.termination);
}

}  // namespace

void add_identify(CLI::App& app, const std::vector<std::string>& command_line) {
  auto c = std::make_shared<IdentifyCommand>();
  c->command_line = command_line;
  CLI::App* command = app.add_subcommand(
      "identify",
      "Fit a model's parameters to recordings; physically consistent, with uncertainties.");
  add_robot(*command, c->model);
  add_options(*command, c->reading);
  command
      ->add_option("data", c->data,
                   "recordings: time, q_*, tau_*; or ball_x, ball_y, ball_z; CSV or another format "
                   "(docs/recordings.md)")
      ->required();
  command->add_option("--test", c->test, "held-out recordings (.csv), never fitted");
  command->add_option("-o,--output", c->out, "folder for the results")->required();
  add_options(*command, c->options);
  command
      ->add_option("--prior", c->prior,
                   "on the inertias: none, or entropic=STRENGTH (log det distance to the model)")
      ->capture_default_str();
  add_recording_options(*command, c->recording);
  add_common(*command, c->common);
  command->callback([c, command] { run_identify(*c, *command); });
}

}  // namespace diffnea::apps
