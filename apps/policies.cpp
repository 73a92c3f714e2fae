#include "policies.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>

#include <diffnea/io/policy_file.hpp>

namespace diffnea::apps {
namespace {

using Clock = std::chrono::steady_clock;

VecX<double> vector(const std::vector<double>& values) {
  return Eigen::Map<const VecX<double>>(values.data(), static_cast<long>(values.size()));
}

/// How far all seeds are, as one line.
class SeedProgress {
 public:
  SeedProgress(ProgressLine& line, int seeds) : line_(line), seeds_(seeds) {}

  void iterated(std::uint64_t seed, const Ereps& search, long rollouts) {
    rollouts_[seed] = rollouts;
    const ErepsIteration& last = search.history().back();
    char text[200];
    std::snprintf(
        text, sizeof text,
        " %d of %d done; seed %llu, iteration %d: reward %.2f (best %.2f), caught %.0f %%, "
        "KL %.2f, entropy %.1f, %.0f rollouts/s",
        done_, seeds_, static_cast<unsigned long long>(seed), last.iteration, last.reward_mean,
        last.reward_best, 100.0 * last.solved_share, last.kl_update, last.entropy,
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
  int seeds_, done_ = 0;
  std::map<std::uint64_t, long> rollouts_;
  Clock::time_point start_ = Clock::now();
};

}  // namespace

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
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command.add_option("--hold", l.promp.hold, "after the movement [s]; success is judged there")
      ->check(at_least(0.0))
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
  command.add_flag("--fresh", o.fresh, "start over instead of going on from checkpoints");
}

BallInCup task_of(const Model& model, const Model& controller, const PolicyOptions& o) {
  LearnOptions learn = o.learn;
  learn.start = vector(o.start);
  learn.nominal_string = o.string.value_or(0.0);
  learn.simulator.controller.kp = vector(o.kp);
  learn.simulator.controller.kd = vector(o.kd);
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
  if (o.fresh) std::filesystem::remove_all(checkpoints);
  std::filesystem::create_directories(checkpoints);
  const std::string print = fingerprint(task);
  const auto file = [&](std::uint64_t seed) {
    return checkpoints / ("seed_" + std::to_string(seed) + ".json");
  };
  SeedProgress progress(line, o.seeds);
  SeedHooks hooks;
  hooks.resume = [&](std::uint64_t seed) {
    return read_checkpoint(file(seed), print, first_search(task, seed));
  };
  hooks.iterated = [&](std::uint64_t seed, const Ereps& search, long rollouts) {
    write_checkpoint(search, print, file(seed));
    progress.iterated(seed, search, rollouts);
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
