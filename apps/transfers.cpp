#include "transfers.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

#include <diffnea/io/sidecar.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/runs/policy_file.hpp>

namespace diffnea::apps {
namespace {

/// Jobs 0 … count − 1 on several threads, until Ctrl-C. `make()` gives each thread its own job.
/// @param done  how many are finished, one call at a time
void run_jobs(int count, int threads, const std::function<std::function<void(int)>()>& make,
              const std::function<void(int)>& done) {
  std::atomic<int> next = 0;
  int finished = 0;
  std::mutex one_at_a_time;
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      const std::function<void(int)> job = make();
      for (int k = next++; k < count && !Interruptible::requested(); k = next++) {
        job(k);
        const std::scoped_lock lock(one_at_a_time);
        done(++finished);
      }
    } catch (...) {
      const std::scoped_lock lock(one_at_a_time);
      if (!failure) failure = std::current_exception();
      next = count;
    }
  };
  {
    std::vector<std::jthread> others;
    for (int t = 1; t < std::min(threads, count); ++t) others.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

/// Executions, each thread in a simulator of its own.
/// @param run  (simulator, job) → execution
std::vector<Execution> all(const Simulator& world, int count, int threads,
                           const std::function<Execution(const Simulator&, int)>& run,
                           const std::function<void(int)>& done) {
  std::vector<std::optional<Execution>> found(static_cast<std::size_t>(count));
  run_jobs(
      count, threads,
      [&] {
        return [&, own = std::shared_ptr<Simulator>(world.clone())](int k) {
          found[static_cast<std::size_t>(k)] = run(*own, k);
        };
      },
      done);
  std::vector<Execution> out;
  for (std::optional<Execution>& e : found) {
    if (!e) break;  // interrupted
    out.push_back(std::move(*e));
  }
  return out;
}

auto counted(ProgressLine& line, const char* what, int count) {
  return [&line, what, count](int done) {
    line.show(what, " " + std::to_string(done) + " of " + std::to_string(count));
  };
}

}  // namespace

void add_transfer_options(CLI::App& command, TransferOptions& o) {
  command
      .add_option("--world", o.world,
                  "mujoco:NAME[,key=value...] with a ball and a cup (see `diffnea worlds`)")
      ->capture_default_str();
  command.add_option("--rope", o.rope, "heavy, mid, light, none: the world's string")
      ->check(CLI::IsMember({"heavy", "mid", "light", "none"}));
  command.add_flag("--record", o.record,
                   "keep what the robot's sensors see of every policy, with their noise: "
                   "recording_SEED.csv, for identify and diagnose");
  command.add_option("--repetitions", o.repetitions, "of the best policy, with noise")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  command
      .add_option("--torque-noise", o.simulator.torque_noise,
                  "of the drives in repetitions [N*m], times a joint's size")
      ->check(at_least(0.0))
      ->capture_default_str();
  command
      .add_option("--posture-noise", o.simulator.encoder_noise,
                  "of the posture in repetitions, constant through one [rad]")
      ->check(at_least(0.0))
      ->capture_default_str();
}

std::string record_policies(TransferRun& run, const TransferOptions& o, const CommonOptions& common,
                            const std::filesystem::path& folder, ProgressLine& line) {
  const WorldSpec world = world_of(o);
  RecordOptions options;
  static_cast<ControllerOptions&>(options) = run.task.options.simulator.controller;
  options.scale_noise(world.noise);
  const int count = static_cast<int>(run.policies.size());
  std::vector<std::string> problems(run.policies.size());
  const auto record = [&](const LearnedPolicy& policy, const Execution& execution) -> std::string {
    if (execution.trace.time.size() == 0)  // the motion breaks a limit
      return recording_file_name(policy.seed) + ": was not recorded: " + execution.failure;
    const std::string name = recording_file_name(policy.seed), file = (folder / name).string();
    try {
      const SimulatedRecording seen =
          record_in_world(world, run.task.controller, desired_motion(policy, options.control_rate),
                          options, common.seed, /*threads=*/1, policy.seed)
              .result;
      write_recording(seen.recording, file);
      write_sidecar(seen.recording.info, file);
      return seen.failure.empty() ? "" : name + ": the recording ended early: " + seen.failure;
    } catch (const Error& error) {
      std::error_code ignored;
      std::filesystem::remove(file, ignored);  // without its sidecar it would be read wrongly
      return name + ": was not written: " + error.what();
    }
  };
  run_jobs(
      count, threads_of(common),
      [&] {
        return [&](int k) {
          const auto i = static_cast<std::size_t>(k);
          problems[i] = record(run.policies[i], run.executions[i]);
        };
      },
      counted(line, "recording policy", count));
  run.interrupted = Interruptible::requested();
  std::string out;
  for (const std::string& problem : problems)
    if (!problem.empty()) out += problem + "\n";
  return out;
}

std::string world_name(const TransferOptions& o) {
  if (o.rope.empty()) return o.world;
  std::string out = o.world;  // of two ropes the option's stays
  if (const std::size_t at = out.find(",rope="); at != out.npos)
    out.erase(at, std::min(out.find(',', at + 1), out.size()) - at);
  return out + ",rope=" + o.rope;
}

WorldSpec world_of(const TransferOptions& o) {
  WorldSpec spec = parse_world(world_name(o));
  if (o.string && !spec.string && !spec.nominal_string) spec.nominal_string = o.string;
  return spec;
}

TransferRun transfer_policies(const LearnRun& learned, const TransferOptions& o,
                              const CommonOptions& common, ProgressLine& line) {
  const auto begin = std::chrono::steady_clock::now();
  TransferRun run;
  run.task = learned.task;
  run.policies = learned.policies;
  run.imagined = learned.imagined;
  run.imagined.resize(run.policies.size());  // empty where the series were not kept
  run.world = world_name(o);
  const BallInCup& task = learned.task;
  const WorldSpec spec = world_of(o);
  run.differences = differences(spec);
  MujocoSimulatorOptions quiet;
  quiet.controller = task.options.simulator.controller;
  MujocoSimulatorOptions noisy = o.simulator;
  noisy.controller = quiet.controller;
  const int threads = threads_of(common);
  const MotionLimits limits = motion_limits(task.controller);
  const CupSpec cup = *task.model.cup;
  const auto world = make_simulator(spec, task.controller, quiet, common.seed);
  const int policies = static_cast<int>(run.policies.size());
  run.executions = all(
      *world, policies, threads,
      [&](const Simulator& own, int k) {
        return execute(run.policies[static_cast<std::size_t>(k)], own, limits, cup, common.seed);
      },
      counted(line, "executing policy", policies));
  for (std::size_t k = 0; k < run.executions.size(); ++k) {
    const Execution& e = run.executions[k];
    if (!e.failure.empty()) continue;
    const auto better = [&](const Execution& than) {
      return std::pair(e.success(), e.reward) > std::pair(than.success(), than.reward);
    };
    if (run.best < 0 || better(run.executions[static_cast<std::size_t>(run.best)]))
      run.best = static_cast<int>(k);
  }
  if (run.best >= 0 && !Interruptible::requested()) {
    const auto disturbed = make_simulator(spec, task.controller, noisy, common.seed);
    run.repetitions = all(
        *disturbed, o.repetitions, threads,
        [&](const Simulator& own, int k) {
          return execute(run.policies[static_cast<std::size_t>(run.best)], own, limits, cup,
                         common.seed + 1 + static_cast<std::uint64_t>(k));
        },
        counted(line, "repeating the best policy,", o.repetitions));
  }
  run.interrupted = Interruptible::requested();
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return run;
}

}  // namespace diffnea::apps
