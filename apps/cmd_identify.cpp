#include <algorithm>

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
#include "outputs.hpp"
#include "recordings.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

/// The inertias are the model's then, to nine digits; beyond, squares of the strength drown the
/// data.
constexpr double kStrongestPrior = 1e9;

/// Losses of the arm, and the one of a ball's string.
std::vector<std::string> losses() {
  std::vector<std::string> out = names_of<Loss>();
  out.emplace_back("constrained");
  return out;
}

struct IdentifyCommand {
  CommonOptions common;
  std::vector<std::string> command_line;
  RecordingOptions recording;
  std::string model, out, prior = "none", loss = "inverse", robust = "none";
  std::vector<std::string> data, test, effects;
  bool effects_given = false;
  bool window_given = false, ball_window_given = false, lambda_given = false;
  IdentifyOptions options;
};

/// An option that nothing would look at is a mistake of whoever gave it.
void refuse_without_effect(const IdentifyCommand& c, const Model& model) {
  const auto refuse = [](const std::string& option, const std::string& why) {
    throw CLI::ValidationError(option, why);
  };
  if (c.loss == "trajectory" && c.robust != "none")
    refuse("--robust", "the trajectory loss has no weights to lose; use --loss inverse or forward");
  if (c.loss == "trajectory" && c.prior != "none")
    refuse("--prior", "the trajectory loss has none; use --loss inverse or forward");
  if (c.loss != "trajectory" && c.window_given)
    refuse("--window", "is of --loss trajectory (of a ball: --ball-window)");
  if (c.loss != "constrained" && c.lambda_given) refuse("--lambda", "is of --loss constrained");
  if (model.ball) return;
  const std::string none = "is of a ball, and " + c.model + " has none";
  if (c.loss == "constrained") refuse("--loss constrained", none);
  if (c.ball_window_given) refuse("--ball-window", none);
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

void run_identify(IdentifyCommand c) {
  refuse_repeated_files(c.data, c.test);
  c.recording.quiet = c.common.quiet;
  set_prior(c.prior, c.options);
  if (c.loss == "constrained")
    c.options.ball.loss = BallLoss::kConstrained;  // the arm has no constraint to adhere to
  else
    c.options.loss = value_of<Loss>(c.loss, "--loss");
  c.options.robust = value_of<Robust>(c.robust, "--robust");
  if (c.effects_given)
    c.options.choice.effects = c.effects == std::vector<std::string>{"none"}
                                   ? std::vector<std::string>{}
                                   : with_pairs(c.effects);
  c.options.trajectory.threads = threads_of(c.common);
  check_run_folder(c.out, "identify");
  const Model model = read_model(c.model);
  refuse_without_effect(c, model);
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
    const std::unique_ptr<RecordingSource> train =
        open_recordings(model, c.data, c.recording, line);
    std::unique_ptr<RecordingSource> test;
    if (!c.test.empty()) test = open_recordings(model, c.test, c.recording, line);
    run.fit = identify(model, *train, test.get(), c.options);
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
  IdentifyOptions& o = c->options;
  CLI::App* command = app.add_subcommand(
      "identify",
      "Fit a model's parameters to recordings; physically consistent, with uncertainties.");
  add_robot(*command, c->model);
  command
      ->add_option("data", c->data,
                   "recordings (.csv): time, q_*, tau_*; or ball_x, ball_y, ball_z")
      ->required();
  command->add_option("--test", c->test, "held-out recordings (.csv), never fitted");
  command->add_option("-o,--output", c->out, "folder for the results")->required();
  command
      ->add_option("--loss", c->loss,
                   "of torque (inverse), acceleration (forward), or trajectory; constrained: of a "
                   "ball's acceleration and its string, where otherwise its trajectory is fitted")
      ->check(CLI::IsMember(losses()))
      ->capture_default_str();
  command->add_option("--robust", c->robust, "weights that outliers lose by")
      ->check(CLI::IsMember(names_of<Robust>()))
      ->capture_default_str();
  command
      ->add_option(
          "--fit", o.choice.fit,
          "what may move, separated by commas: inertia, armature, effects, string (of a ball: its "
          "length and attachment), shapes (of effects), "
          "kinematics (fixed transforms; kinematics@JOINT for one)")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option(
          "--effects", c->effects,
          "beyond those of the model: name, name@joint or name@joint,joint, separated by commas; "
          "payload@tip:run=1 acts in recording 1 alone (from 0, those of --test last); none; "
          "default: armature, viscous and Coulomb friction and an offset at every joint; "
          "with torque sensors behind the drive (--torque-side link) the offset alone; of a ball "
          "on a string linear_drag, in free flight quadratic_drag")
      ->delimiter(',')
      ->each([raw = c.get()](const std::string&) { raw->effects_given = true; });
  command->add_option(
      "--fix", o.choice.fix,
      "parameters to hold at the model's value: names, or patterns with *; at another: "
      "NAME=VALUE");
  command
      ->add_option("--prior", c->prior,
                   "on the inertias: none, or entropic=STRENGTH (log det distance to the model)")
      ->capture_default_str();
  add_recording_options(*command, c->recording);
  command
      ->add_option("--filter", o.preprocess.filter_hz, "low-pass of the positions [Hz], 0: chosen")
      ->check(at_least(0.0))
      ->capture_default_str();
  command->add_option("--decimate", o.preprocess.decimate_to_hz, "rate of the fit [Hz], 0: chosen")
      ->check(at_least(0.0))
      ->capture_default_str();
  const auto note_if_given = [](bool& given) {
    return [&given](const std::string&) { given = true; };
  };
  command
      ->add_option("--window", o.trajectory.window,
                   "trajectory loss: length of a simulated window [s]")
      ->check(at_least(0.0, true))
      ->each(note_if_given(c->window_given))
      ->capture_default_str();
  command
      ->add_option("--ball-window", o.ball.window,
                   "ball: length of a simulated window [s], at most; each starts from a state of "
                   "its own, which is estimated")
      ->check(at_least(0.0, true))
      ->each(note_if_given(c->ball_window_given))
      ->capture_default_str();
  command
      ->add_option("--lambda", o.ball.lambda,
                   "constrained loss: weights of g, its first and its second derivative, each over "
                   "its own noise")
      ->delimiter(',')
      ->check(at_least(0.0))
      ->each(note_if_given(c->lambda_given))
      ->capture_default_str();
  add_common(*command, c->common);
  command->callback([c] { run_identify(*c); });
}

}  // namespace diffnea::apps
