#include <cstdio>
#include <sstream>

#include <diffnea/core/text_file.hpp>
#include <diffnea/experiment/robot_data.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/sidecar.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/report/learn_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/report/transfer_text.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/version.hpp>

#include "common.hpp"
#include "outputs.hpp"
#include "policies.hpp"
#include "transfers.hpp"

namespace diffnea::apps {
namespace {

struct ExperimentCommand {
  CommonOptions common;
  std::vector<std::string> command_line;
  std::string task, model = "wam4_ball_in_cup", out;
  bool nominal = false;
  RobotData data;
  PolicyOptions policies;
  TransferOptions transfer;
  ExperimentCommand() { policies.seeds = 10; }  // one policy tells little of a world
};

/// The stages one after the other, each with its files in a folder of its own.
class Experiment {
 public:
  explicit Experiment(const ExperimentCommand& c)
      : c_(c),
        out_(c.out),
        line_(c.common.quiet),
        file_(find_model_file(c.model, {".xml", ".json", ".urdf"})),
        nominal_(read_model(file_)) {
    if (c.policies.string && nominal_.ball && nominal_.ball->string)
      nominal_.ball->string->length = *c.policies.string;
    check_run_folder(out_, "experiment");  // no run leaves files in there, its stages do
    for (const char* stage : {"identify-arm", "identify-ball"})
      check_run_folder(out_ / stage, "identify");
    check_run_folder(out_ / "policy", "learn");
    check_run_folder(out_ / "transfer", "transfer");
    std::filesystem::create_directories(out_);
    keep_manifest();
  }

  /// @return false: interrupted
  bool run() {
    PolicyOptions first = c_.policies;
    // The posterior is yet to come; what varies beside it can be tried now.
    if (!c_.nominal && first.robust && first.vary.empty()) first.plain();
    const BallInCup task = task_of(nominal_, nominal_, first);  // refused now, not later
    const std::filesystem::path identified = out_ / "identify-ball" / "model.json";
    if (!c_.nominal && !std::filesystem::exists(identified) && !identify(task.start)) return false;
    // From the file, whether it was written now or before: the same numbers.
    const LearnRun learned = learn(c_.nominal ? nominal_ : read_model(identified));
    if (learned.policies.empty() || learned.interrupted) return false;
    return transfer(learned);
  }

 private:
  /// What the recordings and the identification depend on, a line each: experiment.txt. Another
  /// experiment's folder is refused before anything in it changes.
  void keep_manifest() {
    char numbers[300];
    std::snprintf(numbers, sizeof numbers,
                  "string %.17g\nnominal %d\narm-seconds %.17g\nball-seconds "
                  "%.17g\nball-repetitions %d\nseed %llu\n",
                  c_.policies.string.value_or(0.0), int(c_.nominal), c_.data.arm_seconds,
                  c_.data.ball_seconds, c_.data.ball_repetitions,
                  static_cast<unsigned long long>(c_.common.seed));
    const std::string manifest =
        "model " + file_.string() + "\nworld " + world_name(c_.transfer) + "\n" + numbers;
    const std::filesystem::path path = out_ / "experiment.txt";
    if (!std::filesystem::exists(path)) {
      for (const char* name : {"arm-motion.csv", "ball-motion.csv", "arm.csv", "ball.csv"})
        if (std::filesystem::exists(out_ / name))
          throw FileError((out_ / name).string() +
                          ": is of no experiment, which would replace it; choose another -o");
    } else if (!c_.policies.fresh) {
      std::istringstream before(read_text_file(path)), now(manifest);
      for (std::string a, b; std::getline(before, a) && std::getline(now, b);)
        if (a != b)
          throw FileError(out_.string() + ": holds another experiment (" + a + ", now " + b +
                          "); choose another -o, or --fresh to begin again");
    }
    if (c_.policies.fresh)
      for (const char* stage : {"identify-arm", "identify-ball"})
        std::filesystem::remove_all(out_ / stage);
    for (const char* name : {"arm.csv", "ball.csv"}) sidecar_path(out_ / name);  // may refuse
    write_file_atomically(path, manifest);
  }

  void say(const std::string& text) {
    line_.clear();
    if (!c_.common.quiet && !c_.common.json) std::printf("%s\n", text.c_str());
    std::fflush(stdout);
  }

  Trajectory designed(DesignOptions design, const char* name) {
    design.progress = [&](const FitProgress& progress) {
      line_.show(std::string("designing ") + name + ",", " " + progress.stage);
      return !Interruptible::requested();
    };
    const Excitation e = design_excitation(nominal_, design);
    write_trajectory(e.trajectory, (out_ / (std::string(name) + "-motion.csv")).string());
    return e.trajectory;
  }

  Recording recorded(const WorldSpec& world, const Trajectory& motion, const char* name) {
    line_.show(std::string("recording ") + name, "");
    RecordOptions options;
    options.scale_noise(world.noise);
    options.follow = true;  // like `simulate`
    const SimulatedRecording r =
        record_in_world(world, nominal_, motion, options, c_.common.seed, threads_of(c_.common))
            .result;
    if (!r.failure.empty())
      throw DataError(std::string("the recording of ") + name + " ended early: " + r.failure);
    const std::string file = (out_ / (std::string(name) + ".csv")).string();
    write_recording(r.recording, file);
    write_sidecar(r.recording.info, file);
    return r.recording;
  }

  /// @return false: interrupted
  bool identify(const VecX<double>& home) {
    WorldSpec arm = world_of(c_.transfer), ball = arm;
    arm.has_ball = false;
    arm.rope.reset();
    arm.string.reset();
    ball.repetitions = c_.data.ball_repetitions;
    const Trajectory arm_motion = designed(arm_excitation(c_.data, c_.common.seed + 1), "arm");
    const Trajectory ball_motion =
        designed(ball_excitation(nominal_, home, c_.data, c_.common.seed + 2), "ball");
    if (Interruptible::requested()) return false;
    const Recording arm_data = recorded(arm, arm_motion, "arm"),
                    ball_data = recorded(ball, ball_motion, "ball");
    IdentifiedRobot robot =
        identify_robot(nominal_, arm_data, ball_data, [&](const FitProgress& progress) {
          line_.show(progress);
          return !Interruptible::requested();
        });
    if (Interruptible::requested()) return false;
    publish(robot.arm, "identify-arm", "arm.csv");
    publish(robot.ball, "identify-ball", "ball.csv");
    char text[200];
    std::snprintf(text, sizeof text,
                  "identified from %.0f s of the arm and %d times %.0f s of the "
                  "ball: string %.4f m",
                  c_.data.arm_seconds, c_.data.ball_repetitions, c_.data.ball_seconds,
                  robot.model.ball->string->length);
    say(text);
    return true;
  }

  void publish(IdentifyResult& fit, const char* name, const char* data) {
    ResultFolder folder(out_ / name);
    FitRun run{.fit = std::move(fit), .reproduce = reproduce()};
    run.reproduce.inputs.push_back(describe_input("data", out_ / data));
    publish_fit_run(run, folder);
    fit = std::move(run.fit);
  }

  Reproduce reproduce() const {
    Reproduce out;
    out.version = version();
    out.command = c_.command_line;
    out.inputs.push_back(describe_input("model", file_));
    return out;
  }

  LearnRun learn(const Model& model) {
    const BallInCup task = task_of(model, nominal_, c_.policies);
    ResultFolder folder(out_ / "policy");
    LearnRun run = learn_with_checkpoints(task, c_.policies, c_.common, folder.path(), line_);
    if (run.policies.empty()) return run;
    run.reproduce = reproduce();
    publish_learn_run(run, folder);
    say(learn_text(run));
    if (const std::string why = why_not_usable(run); !why.empty() && !run.interrupted)
      stop(kNoUsableResult, why);
    return run;
  }

  bool transfer(const LearnRun& learned) {
    ResultFolder folder(out_ / "transfer");
    TransferRun run = transfer_policies(learned, c_.transfer, c_.common, line_);
    if (run.executions.empty()) return false;
    run.reproduce = reproduce();
    std::string lost;
    if (c_.transfer.record && !run.interrupted)
      lost = record_policies(run, c_.transfer, c_.common, folder.staging(), line_);
    publish_transfer_run(run, folder);
    line_.clear();
    const std::string text = c_.common.json ? transfer_result_json(run) : transfer_text(run);
    std::fwrite(text.data(), 1, text.size(), stdout);
    say("open " + (folder.path() / "report.html").string());
    std::fputs(lost.c_str(), stderr);
    if (!lost.empty() && !run.interrupted) throw CLI::RuntimeError(kNoUsableResult);
    return !run.interrupted;
  }

  const ExperimentCommand& c_;
  std::filesystem::path out_;
  ProgressLine line_;
  std::filesystem::path file_;
  Model nominal_;
};

void run_experiment(ExperimentCommand c) {
  c.transfer.string = c.policies.string;
  const Interruptible interruptible;
  Experiment experiment(c);
  if (experiment.run()) return;
  stop(kInterrupted, "interrupted: the same command goes on from what is finished in " + c.out +
                         " (the identification, the search's last iteration)");
}

}  // namespace

void add_experiment(CLI::App& app, const std::vector<std::string>& command_line) {
  auto c = std::make_shared<ExperimentCommand>();
  c->command_line = command_line;
  CLI::App* command = app.add_subcommand(
      "experiment",
      "The whole loop: excite, record in a world, identify, learn in the identified model, "
      "transfer "
      "back to the world.\n"
      "Leaves motions, recordings and, with a page each, identify-arm, identify-ball, policy, "
      "transfer. Deterministic for a seed; interrupted, the same command goes on.");
  command->add_option("task", c->task, "ball-in-cup")
      ->required()
      ->check(CLI::IsMember({"ball-in-cup"}));
  command->add_option("--model", c->model, "nominal description of the robot, ball and cup")
      ->capture_default_str();
  command->add_option("-o,--output", c->out, "folder")->required();
  command->add_flag("--nominal", c->nominal,
                    "learn in the nominal description instead: nothing is recorded");
  command->add_option("--arm-seconds", c->data.arm_seconds, "recording of the arm [s]")
      ->check(at_least(1.0))
      ->capture_default_str();
  command->add_option("--ball-seconds", c->data.ball_seconds, "recording of the ball [s]")
      ->check(at_least(1.0))
      ->capture_default_str();
  command->add_option("--ball-repetitions", c->data.ball_repetitions, "that are averaged")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  add_policy_options(*command, c->policies);
  add_transfer_options(*command, c->transfer);
  add_common(*command, c->common);
  command->callback([c] { run_experiment(*c); });
}

}  // namespace diffnea::apps
