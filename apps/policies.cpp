#include "policies.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fcntl.h>
#include <map>
#include <set>
#include <sys/file.h>
#include <unistd.h>

#include <diffnea/runs/policy_file.hpp>

namespace diffnea::apps {
namespace {

using Clock = std::chrono::steady_clock;

/// How far all seeds are, as one line.
class SeedProgress {
 public:
  SeedProgress(ProgressLine& line, int seeds, const RobustOptions& robust)
      : line_(line), seeds_(seeds), each_(std::max(robust.each, 1)), draws_(robust.draws) {}

  void iterated(std::uint64_t seed, const SearchState& state) {
    const auto [first, is_new] =
        before_.emplace(seed, state.rollouts - long{each_} * state.search.options().samples);
    rollouts_[seed] = state.rollouts - first->second;
    const ErepsIteration& last = state.search.history().back();
    char text[240], where[40] = "";
    if (draws_ > 0) std::snprintf(where, sizeof where, " in %d of %d draws", each_, draws_);
    std::snprintf(
        text, sizeof text,
        " %d of %d done; seed %llu, iteration %d: reward %.2f (best %.2f), caught %.0f %%%s, "
        "KL %.2f, entropy %.1f, %.0f rollouts/s",
        done_, seeds_, static_cast<unsigned long long>(seed), last.iteration, last.reward_mean,
        last.reward_best, 100.0 * last.solved_share, where, last.kl_update, last.entropy,
        static_cast<double>(total()) / seconds());
    line_.show("learning,", text);
  }
  void learned() { ++done_; }
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  long total() const {
    long sum = 0;
    for (const auto& [seed, count] : rollouts_) sum += count;
    return sum;
  }
  ProgressLine& line_;
  int seeds_, each_, draws_, done_ = 0;
  std::map<std::uint64_t, long> before_, rollouts_;  ///< of earlier processes, of this one
  Clock::time_point start_ = Clock::now();
};

/// A folder that one process at a time learns in.
class Lock {
 public:
  explicit Lock(const std::filesystem::path& folder)
      : file_(::open((folder / "lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644)) {
    if (file_ >= 0 && ::flock(file_, LOCK_EX | LOCK_NB) == 0) return;
    if (file_ >= 0) ::close(file_);
    throw FileError(folder.string() +
                    ": another process learns there; wait for it, or choose another -o");
  }
  ~Lock() { ::close(file_); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  int file_;
};

std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> out;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().filename() != "lock") out.push_back(entry.path());
  return out;
}

/// What a process that was killed had begun to write.
void remove_abandoned(const std::filesystem::path& checkpoints) {
  for (const std::filesystem::path& path : files_in(checkpoints))
    if (path.extension() == ".tmp") std::filesystem::remove(path);
}

/// Policies that this run would take away with it.
void refuse_other_seeds(const std::filesystem::path& folder,
                        const std::vector<std::uint64_t>& seeds) {
  std::set<std::string> own;
  for (const std::uint64_t seed : seeds) own.insert(policy_file_name(seed));
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("policy_") && name.ends_with(".json") && !own.contains(name))
      throw FileError(entry.path().string() +
                      ": is of a seed that is not asked for and would be lost; ask for it too "
                      "(--seed, --seeds), choose another -o, or --fresh");
  }
}

}  // namespace

std::string why_not_usable(const LearnRun& run) {
  long rollouts = 0;
  for (const LearnedPolicy& policy : run.policies) {
    if (policy.solved) return "";
    rollouts += policy.rollouts;
  }
  return std::string("no usable result: no policy catches the ball in the model") +
         (rollouts == 0 ? "; every movement broke a joint's limit: take a smaller --weight-std"
                        : "; is the task in reach of these joints and this string? More "
                          "--iterations, --samples or another --duration may do");
}

void add_policy_options(CLI::App& command, PolicyOptions& o) {
  LearnOptions& l = o.learn;
  command
      .add_option("--string", o.string,
                  "which string is on the robot: its nominal length [m]; a length that was "
                  "identified stays; default: the model's")
      ->check(at_least(0.0, true));
  command.add_option("--seeds", o.seeds, "policies, learned from so many seeds from --seed on")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      .add_option("--joints", l.joints,
                  "that move, separated by commas; default: those that turn the cup in the "
                  "upright plane of its arm")
      ->delimiter(',');
  command
      .add_option("--start", o.start,
                  "posture [rad, m], separated by commas; default: the description's `home`")
      ->delimiter(',');
  command.add_option("--duration", l.promp.duration, "of the movement [s]")
      ->check(in_range(0.05, 60.0))
      ->capture_default_str();
  command.add_option("--hold", l.promp.hold, "after the movement [s]; success is judged there")
      ->check(in_range(SuccessOptions{}.window, 60.0))
      ->capture_default_str();
  command.add_option("--bases", l.promp.bases, "radial bases a joint")
      ->check(CLI::Range(5, 200))
      ->capture_default_str();
  command.add_option("--samples", l.ereps.samples, "rollouts an iteration")
      ->check(CLI::Range(2, 100000))
      ->capture_default_str();
  command.add_option("--iterations", l.ereps.iterations, "at most")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command.add_option("--epsilon", l.ereps.epsilon, "bound on the KL of the samples' weights [nat]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command.add_option("--kappa", l.ereps.kappa, "bound on the KL of the Gaussian's update [nat]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command.add_option("--stop-std", l.ereps.stop_std, "of every weight, at which a search is done")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command.add_option("--weight-std", l.weight_std, "of the first weights [rad]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command.add_option("--dipole", l.reward.epsilon, "of the reward [m^2]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command.add_option("--lambda-q", l.reward.lambda_q, "weight of joint positions in the reward")
      ->check(at_least(0.0))
      ->capture_default_str();
  command.add_option("--lambda-qd", l.reward.lambda_qd, "weight of joint velocities")
      ->check(at_least(0.0))
      ->capture_default_str();
  command
      .add_option("--slack", l.reward.lambda_slack,
                  "weight of the string's slack while the ball is free; 0: the paper's reward")
      ->check(at_least(0.0))
      ->capture_default_str();
  command
      .add_option("--kp", o.kp,
                  "gain per joint [N*m/rad], separated by commas; default: from "
                  "the controller's model")
      ->delimiter(',')
      ->check(at_least(0.0));
  command.add_option("--kd", o.kd, "gain per joint [N*m*s/rad]")
      ->delimiter(',')
      ->check(at_least(0.0));
  command
      .add_option("--bandwidth", l.simulator.controller.bandwidth,
                  "of the controller, where gains are not given [rad/s]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command.add_flag("--robust", o.robust,
                   "for all models that the recordings leave possible: samples are executed in "
                   "draws of the posterior that identify left in the model");
  command.add_option("--draws", o.draws, "with --robust: of the posterior")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      .add_option("--each", l.robust.each,
                  "with --robust: draws that a sample is executed in, so many rollouts; default: "
                  "1, with --quantile 8")
      ->check(CLI::Range(1, 100000));
  command
      .add_option("--quantile", l.robust.quantile,
                  "with --robust: a sample's reward is this quantile of those it got, instead of "
                  "the mean")
      ->check(in_range(1e-6, 1.0));
  command
      .add_option("--vary", o.vary,
                  "with --robust: a parameter that draws have anywhere within a range, e.g. "
                  "string.string_mass.mass_ratio=0:0.1; repeatable, see `diffnea effects`")
      ->type_name("PARAMETER=LOW:HIGH")
      ->expected(1)
      ->take_all();
  command.add_flag("--fresh", o.fresh, "start over instead of going on from checkpoints");
}

BallInCup task_of(const Model& model, const Model& controller, const PolicyOptions& o) {
  LearnOptions learn = o.learn;
  learn.start = vector_of(o.start);
  learn.nominal_string = o.string.value_or(0.0);
  learn.simulator.controller.kp = vector_of(o.kp);
  learn.simulator.controller.kd = vector_of(o.kd);
  if (o.robust) learn.robust.draws = o.draws;
  for (const std::string& text : o.vary) learn.robust.vary.push_back(parse_variation(text));
  return ball_in_cup(model, controller, learn);
}

LearnRun learn_with_checkpoints(const BallInCup& task, const PolicyOptions& o,
                                const CommonOptions& common, const std::filesystem::path& folder,
                                ProgressLine& line) {
  LearnRun run;
  run.task = task;
  run.threads = threads_of(common);
  std::vector<std::uint64_t> seeds;
  for (int k = 0; k < o.seeds; ++k) seeds.push_back(common.seed + static_cast<std::uint64_t>(k));
  const std::filesystem::path checkpoints = folder / "checkpoints";
  std::filesystem::create_directories(checkpoints);
  const Lock lock(checkpoints);
  if (o.fresh)
    for (const std::filesystem::path& path : files_in(checkpoints)) std::filesystem::remove(path);
  else
    refuse_other_seeds(folder, seeds);
  remove_abandoned(checkpoints);
  const std::string print = fingerprint(task);
  const auto file = [&](std::uint64_t seed) {
    return checkpoints / ("seed_" + std::to_string(seed) + ".json");
  };
  SeedProgress progress(line, o.seeds, task.options.robust);
  SeedHooks hooks;
  hooks.resume = [&](std::uint64_t seed) {
    return read_checkpoint(file(seed), print, first_search(task, seed));
  };
  hooks.iterated = [&](std::uint64_t seed, const SearchState& state) {
    try {
      write_checkpoint(state, print, file(seed));
    } catch (const FileError& error) {
      throw FileError(std::string(error.what()) + "; once it can, the same command goes on");
    }
    progress.iterated(seed, state);
    return !Interruptible::requested();
  };
  hooks.learned = [&](const LearnedPolicy&) { progress.learned(); };
  run.policies = learn_seeds(task, seeds, run.threads, hooks);
  run.interrupted = Interruptible::requested();
  Rollouts imagine = rollouts(task, 1);
  for (const LearnedPolicy& policy : run.policies)
    run.imagined.push_back(imagine.trace(policy.policy.mean));
  run.seconds = progress.seconds();
  line.clear();
  return run;
}

}  // namespace diffnea::apps
