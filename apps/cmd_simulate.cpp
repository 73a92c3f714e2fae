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
void tell_who_lags(const std::vector<Recording>& runs, const std::string& file) {
  constexpr double kWorthAWord = 0.2;  // of the motion, root mean square
  const Recording& r = runs.front();
  for (long j = 0; j < r.q.cols(); ++j) {
    if (!r.has_tau[static_cast<std::size_t>(j)]) continue;  // passive, or led by its own drive
    double motion = 0.0, off = 0.0;
    for (const Recording& run : runs) {
      const VecX<double> wanted = run.qcmd.col(j);
      motion += (wanted.array() - wanted.mean()).square().sum();
      off += (run.q.col(j) - wanted).squaredNorm();
    }
    const double miss = std::sqrt(off / motion);
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
  if (described.free_base && options.world.empty())
    throw ModelError(options.model + ": simulate: the base '" + described.links[0].name +
                     "' floats, and flights are simulated by MuJoCo: --world mujoco:FILE.xml "
                     "(`diffnea export` writes an MJCF of a URDF); --fix-base holds it where the "
                     "file has it");
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
  std::vector<SimulatedRecording> results;
  Model truth = model;
  if (options.world.empty()) {
    options.record.scale_noise(options.noise.value_or(0.0));
    results = {record_model(model, model, trajectory, options.record)};
  } else {
    const WorldSpec world = parse_world(options.world);
    options.record.scale_noise(options.noise.value_or(world.noise));
    if (model.free_base) {
      WorldFlights flown =
          record_flights_in_world(world, model, trajectory, options.record, options.common.seed);
      results = std::move(flown.flights);
      truth = std::move(flown.truth);
    } else {
      WorldRecording recorded = record_in_world(world, model, trajectory, options.record,
                                                options.common.seed, threads_of(options.common));
      results = {std::move(recorded.result)};
      truth = std::move(recorded.truth);
    }
  }
  const auto print = [&] {
    if (options.common.json) std::fputs(simulate_result_json(results, options.out).c_str(), stdout);
  };
  if (const std::string& failure = results.back().failure; !failure.empty()) {
    print();
    stop(kNoUsableResult,
         options.out + ": the simulation ended early, nothing was written: " + failure);
  }
  std::vector<Recording> runs;
  long rows = 0, saturated = 0;
  for (const SimulatedRecording& result : results) {
    rows += result.recording.rows();
    saturated += result.saturated;
    runs.push_back(result.recording);
  }
  if (!options.truth.empty()) write_model(truth, options.truth);
  write_recordings(runs, options.out);
  write_sidecar(runs.front().info, options.out);
  print();
  if (!options.common.json && !options.common.quiet)
    std::fprintf(stderr, "%s: %s%ld rows, %ld with a torque at its limit\n", options.out.c_str(),
                 model.free_base ? (std::to_string(runs.size()) + " flights, ").c_str() : "", rows,
                 saturated);
  tell_who_lags(runs, options.out);
}

}  // namespace

void add_simulate(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* command = app.add_subcommand(
      "simulate",
      "Follow a desired motion with a controller that knows the model, and record.\n"
      "Without --world the robot is the model itself, without noise; with a MuJoCo world it "
      "differs from it, and its sensors are noisy.\n"
      "A robot that floats is thrown up in a MuJoCo world, once for each --flight of the motion; "
      "its pose is logged.\n"
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
  command
      ->add_option("--flight", options->record.flight,
                   "of a robot that floats: duration of each flight [s]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command->add_option("--rate", options->record.control_rate, "of control and rows [Hz]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  add_common(*command, options->common);
  command->callback([options] { run_simulate(*options); });
}

}  // namespace diffnea::apps
