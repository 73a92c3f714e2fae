#include <cmath>
#include <cstdio>
#include <optional>

#include <diffnea/io/model_file.hpp>
#include <diffnea/io/sidecar.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/runs/simulate_result.hpp>
#include <diffnea/worlds/world.hpp>

#include "common.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "recordings.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

struct SimulateOptions {
  CommonOptions common;
  ModelReading reading;
  std::string model, trajectory, world, out, truth;
  std::optional<double> noise;
  std::vector<double> kp, kd;
  RecordOptions record;
  JointChoice choice;
};

/// Says which joints do not make the motion that was asked for: a recording tells less then than it
/// was designed to.
void tell_who_lags(const Recording& r, const std::string& file) {
  constexpr double kWorthAWord = 0.2;  // of the motion, root mean square
  if (r.qcmd.rows() != r.q.rows()) return;
  for (long j = 0; j < r.q.cols(); ++j) {
    if (!r.has_tau[static_cast<std::size_t>(j)]) continue;  // passive, or led by its own drive
    const VecX<double> wanted = r.qcmd.col(j);
    const double motion = (wanted.array() - wanted.mean()).matrix().norm();
    const double miss = (r.q.col(j) - wanted).norm() / motion;
    if (std::isfinite(miss) && miss > kWorthAWord)
      std::fprintf(stderr,
                   "%s: %s is off its command by %.0f %% of the motion (rms): stiffer gains (--kp, "
                   "--kd) or a slower "
                   "motion follow better\n",
                   file.c_str(), r.joint_names[static_cast<std::size_t>(j)].c_str(), 100.0 * miss);
  }
}

/// Keeps the columns of the joints that move.
void leave_out_others(const std::vector<std::string>& joints, Trajectory& trajectory) {
  std::vector<int> kept;
  std::vector<std::string> names;
  for (int j = 0; j < trajectory.num_joints(); ++j)
    if (std::ranges::find(joints, trajectory.joint_names[static_cast<std::size_t>(j)]) !=
        joints.end()) {
      kept.push_back(j);
      names.push_back(trajectory.joint_names[static_cast<std::size_t>(j)]);
    }
  if (kept.size() == trajectory.joint_names.size()) return;
  trajectory.joint_names = names;
  for (auto member : {&Trajectory::q, &Trajectory::qd, &Trajectory::qdd})
    trajectory.*member = RowMatX<double>((trajectory.*member)(Eigen::all, kept));
}

void run_simulate(SimulateOptions options) {
  const std::vector<std::string> inputs{options.model, options.trajectory};
  // An input that lies where the sidecar would is told before it is asked whose that file is.
  check_output(std::filesystem::path(options.out).replace_extension(".json").string(), inputs);
  check_outputs({options.out, sidecar_path(options.out).string(), options.truth}, inputs);
  if (!options.truth.empty()) check_model_path(options.truth);
  Trajectory trajectory = read_trajectory(options.trajectory);
  const Model described = read_model(options.model, options.reading);
  require_fixed_base("simulate", described);
  std::vector<std::string> moved = trajectory.joint_names;
  for (const JointDescription& joint : describe_joints(described))
    if (joint.passive && std::ranges::find(moved, joint.name) == moved.end())
      moved.push_back(joint.name);  // by the others
  ServedModel served = serve_joints(described, moved, options.choice);
  if (!served.note.empty()) std::fprintf(stderr, "%s\n", served.note.c_str());
  const Model& model = served.model;
  leave_out_others(joint_names(model), trajectory);
  options.record.kp = vector_of(options.kp);
  options.record.kd = vector_of(options.kd);
  options.record.seed = options.common.seed;
  options.record.follow = true;
  SimulatedRecording result;
  Model truth = model;
  if (options.world.empty()) {
    options.record.scale_noise(options.noise.value_or(0.0));
    result = record_model(model, model, trajectory, options.record);
  } else {
    const WorldSpec world = parse_world(options.world);
    options.record.scale_noise(options.noise.value_or(world.noise));
    WorldRecording recorded = record_in_world(world, model, trajectory, options.record,
                                              options.common.seed, threads_of(options.common));
    result = std::move(recorded.result);
    truth = std::move(recorded.truth);
  }
  const auto print = [&] {
    if (options.common.json) std::fputs(simulate_result_json(result, options.out).c_str(), stdout);
  };
  if (!result.failure.empty()) {
    print();
    stop(kNoUsableResult,
         options.out + ": the simulation ended early, nothing was written: " + result.failure);
  }
  if (!options.truth.empty()) write_model(truth, options.truth);
  write_recording(result.recording, options.out);
  write_sidecar(result.recording.info, options.out);
  print();
  if (!options.common.json && !options.common.quiet)
    std::fprintf(stderr, "%s: %ld rows, %ld with a torque at its limit\n", options.out.c_str(),
                 result.recording.rows(), result.saturated);
  tell_who_lags(result.recording, options.out);
}

}  // namespace

void add_simulate(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* command = app.add_subcommand(
      "simulate",
      "Follow a desired motion with a controller that knows the model, and record.\n"
      "Without --world the robot is the model itself, without noise; with a MuJoCo world it "
      "differs from it, and its sensors are noisy.\n"
      "Joints without a motor follow in closed loops; they are logged without a torque.");
  add_robot(*command, options->model);
  add_options(*command, options->reading);
  add_joint_options(*command, options->choice);
  command->add_option("--trajectory", options->trajectory, "time, qcmd_*, qdcmd_*, qddcmd_* (.csv)")
      ->required();
  command->add_option(
      "--world", options->world,
      "mujoco:NAME[,key=value...]; NAME: wam4, ..., or a path to an MJCF; keys: perturb = none, A "
      "(default), B, C or PATH.json; seed (default: --seed); noise (factor); repetitions; effect = "
      "NAME@WHERE:PARAMETER=VALUE+...; of a ball: ball = tendon, chain; rope; string (see "
      "`diffnea worlds`)");
  command
      ->add_option("-o,--output", options->out,
                   "recording (.csv); what columns cannot hold goes beside it (.json)")
      ->required();
  command->add_option("--truth", options->truth,
                      "write the robot's true parameters (.json), for tests");
  command->add_option("--noise", options->noise, "factor on the sensors' noise")
      ->check(at_least(0.0));
  command
      ->add_option("--period", options->record.period, "of the desired motion [s], if it has one")
      ->check(at_least(0.0));
  command
      ->add_option("--kp", options->kp,
                   "gain per joint [N*m/rad]; default: from the model and the motion, in loops "
                   "by computed torque")
      ->check(at_least(0.0));
  command->add_option("--kd", options->kd, "gain per joint [N*m*s/rad]; default: as --kp")
      ->check(at_least(0.0));
  command->add_option("--rate", options->record.control_rate, "of control and rows [Hz]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  add_common(*command, options->common);
  command->callback([options] { run_simulate(*options); });
}

}  // namespace diffnea::apps
