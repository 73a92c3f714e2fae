#pragma once
/// Ball in a cup, learned offline: a primitive's weights are searched in the identified model, and
/// what was learned is executed in a world that is not the model.
///
///     const BallInCup task = ball_in_cup(model, controller, options);
///     const LearnedPolicy policy = learn(task, /*seed=*/1);
///     const Execution e = execute(policy, *world, motion_limits(model), *model.cup, /*seed=*/0);

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/identify/posterior.hpp>
#include <diffnea/policy/ball_in_cup.hpp>
#include <diffnea/policy/ereps.hpp>
#include <diffnea/policy/rollouts.hpp>
#include <diffnea/recording/trajectory.hpp>
#include <diffnea/sim/ball_in_cup.hpp>
#include <diffnea/sim/model_simulator.hpp>

namespace diffnea {

/// A policy for all models that the recordings leave possible, instead of the fitted one: samples
/// are executed in draws of its posterior (identify/posterior.hpp), those of an iteration in the
/// same ones, those of the next in the next.
struct RobustOptions {
  int draws = 0;
  int each = 0;
  std::optional<double> quantile = {};
  std::vector<Variation> vary = {};
  std::uint64_t seed = 0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("RobustOptions", "Draws of the posterior that samples are executed in.",
              {.exact = true});
    list.field("draws", &RobustOptions::draws,
               "Of the posterior, that the search has; 0: it has the model alone.");
    list.field("each", &RobustOptions::each,
               "Draws that a sample is executed in; 0: 1, with a quantile 8.");
    list.field("quantile", &RobustOptions::quantile,
               "In (0, 1]: the reward of a sample is that quantile of those it got, the smallest "
               "one that a share p of them does not pass. Not given: their mean.");
    list.field("vary", &RobustOptions::vary, "What the posterior says nothing of.");
    list.field("seed", &RobustOptions::seed, "Of the draws.");
  }
};

/// How a movement is learned: where, with how many seeds, from which start.
struct LearnOptions {
  std::vector<std::string> joints;  ///< that move; empty: those that turn the cup in the plane it
                                    ///< hangs in at the start
  VecX<double> start;               ///< posture q_0 (n) [rad]; empty: of the model's file, `home`
  PrompSpec promp;                  ///< its joints are those above
  ErepsOptions ereps;               ///< of the search
  double weight_std = 0.4;          ///< of the first Gaussian's weights [rad]
  /// Which string is on the robot [m]; 0: not said. A length that was identified stays; a
  /// description's, which nobody measured, becomes this.
  double nominal_string = 0.0;
  BallInCupOptions reward;          ///< its string is the model's
  ModelSimulatorOptions simulator;  ///< of the model; its controller is the robot's, too
  RobustOptions robust;             ///< draws that samples are executed in, if any
  /// Settings that transfer (docs/policy.md): a fast controller, gentle movements that keep the
  /// string taut.
  LearnOptions() {
    promp.duration = 1.0;
    reward.lambda_qd = 0.02;
    reward.lambda_slack = 20.0;
    simulator.controller.bandwidth = 25.0;
  }
};

/// All that a search needs.
struct BallInCup {
  Model model;           ///< that samples are executed in, with the string that is on the robot
  Model controller;      ///< that the robot's controller compensates gravity with
  LearnOptions options;  ///< completed
  VecX<double> start;    ///< q_0 of all joints [rad]
  /// Of the posterior, where options.robust wants them: those that a search has, then those that it
  /// is judged in. All have the effects that are varied, which rollouts() adds to `model`, too.
  std::vector<Model> draws = {};
};
/// @param controller  the model that the robot's controller compensates gravity with
/// @throws ModelError if there is no ball on a string, no cup, or no joint can move the cup;
///         DataError if the task cannot be: the cup is upside down at the start, the ball does not
///         fit into it, the string is shorter than the way from its knot over the rim, or was
///         identified as another than the nominal one
BallInCup ball_in_cup(const Model& model, const Model& controller, LearnOptions options);

/// Rollouts of the task's primitive in its model (worlds of seed 0), and in its draws (1, 2, …).
Rollouts rollouts(const BallInCup& task, int threads);

/// What became of a policy's mean in draws of the posterior that its search had not seen.
struct InDraws {
  int count = 0;
  int caught = 0;
  double reward = 0.0;

  /// There were none.
  bool empty() const { return count == 0; }

  template <class List>
  static constexpr void fields(List& list) {
    list.type("InDraws",
              "What became of the mean in draws of the posterior that the search had not seen.",
              {.exact = true});
    list.field("count", &InDraws::count, "0: the search had the model alone.", {.key = "draws"});
    list.field("caught", &InDraws::caught, "In how many of them the ball is caught.");
    list.field("reward", &InDraws::reward, "Mean, or the quantile that was asked for.",
               {.null = -std::numeric_limits<double>::infinity()});
  }
};

/// Which network moved the ball where a policy was learned; empty: none did.
struct NetworkSource {
  std::string file;
  std::string sha256;

  /// There was none.
  bool empty() const { return sha256.empty(); }

  template <class List>
  static constexpr void fields(List& list) {
    list.type("NetworkSource", "The network that moved the ball in the model.", {.exact = true});
    list.field("file", &NetworkSource::file, "File that it was read from.");
    list.field("sha256", &NetworkSource::sha256, "SHA-256 of that file, lower-case hexadecimal.");
  }
};

/// The movement that one seed has learned, and how it was learned.
struct LearnedPolicy {
  std::uint64_t seed = 0;
  PrompSpec promp;
  Gaussian policy;
  std::vector<std::string> joints;
  VecX<double> start;
  ControllerOptions controller;
  BallInCupOptions reward;
  std::vector<ErepsIteration> curve;
  std::string stopped;
  double expected = 0.0;
  bool solved = false;
  long rollouts = 0;
  double seconds = 0.0;
  InDraws in_draws;
  NetworkSource ball_network;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("LearnedPolicy", "The movement that one seed has learned, and how it was learned.",
              {.exact = true});
    list.field("seed", &LearnedPolicy::seed, "Of the search.");
    list.field("joints", &LearnedPolicy::joints, "All of the robot's, moved or not.");
    list.field("start", &LearnedPolicy::start, "Posture q_0 of all joints.", {.unit = "rad"});
    list.field("promp", &LearnedPolicy::promp, "Primitive that the weights are of.",
               {.key = "primitive"});
    list.also("mean", &LearnedPolicy::policy, &Gaussian::mean,
              "Mean of the Gaussian over the weights, joint by joint [rad]; it is executed.");
    list.also("covariance", &LearnedPolicy::policy, &Gaussian::covariance,
              "Its covariance by rows.");
    list.field("controller", &LearnedPolicy::controller, "Gains as they were simulated.");
    list.field("reward", &LearnedPolicy::reward, "Reward that was searched for.");
    list.field("expected", &LearnedPolicy::expected,
               "Reward of the mean in the model; null: it cannot be executed there (−∞).",
               {.optional = true, .null = -std::numeric_limits<double>::infinity()});
    list.field("solved", &LearnedPolicy::solved, "The mean catches the ball in the model.",
               {.optional = true});
    list.field("stopped", &LearnedPolicy::stopped,
               "Why the search ended; empty: it was interrupted.", {.optional = true});
    list.field("rollouts", &LearnedPolicy::rollouts,
               "That the search executed, before it was resumed, too.");
    list.field("seconds", &LearnedPolicy::seconds,
               "Time that the search took, without the pause before it was resumed.",
               {.unit = "s", .optional = true});
    list.field("in_draws", &LearnedPolicy::in_draws,
               "Of the mean; missing: learned in the model alone.", {.absent = true});
    list.field("ball_network", &LearnedPolicy::ball_network,
               "Missing: string and gravity moved the ball.", {.absent = true});
    list.columns("curve", &LearnedPolicy::curve, "One value an iteration.");
    list.in_memory("policy", &LearnedPolicy::policy,
                   "Gaussian over the weights; the mean is executed.");
  }
};

/// Of the task's network.
NetworkSource network_source(const BallInCup& task);

/// A search, and what it took so far.
struct SearchState {
  Ereps search;          ///< between two iterations
  long rollouts = 0;     ///< executed
  double seconds = 0.0;  ///< that passed
};

/// After every iteration. @return false: stop, what was learned is returned
using LearnProgress = std::function<bool(const SearchState&)>;

/// @param from  goes on from it: a search of the same task, options and seed
/// @throws DataError naming iteration, sample and parameters if a reward is NaN
LearnedPolicy learn(const BallInCup& task, std::uint64_t seed, int threads = 1,
                    const LearnProgress& progress = {}, const SearchState* from = nullptr);

/// What a search has found so far, without what execution says of it (expected, solved).
LearnedPolicy found_policy(const BallInCup& task, const Ereps& search);

/// Parameters of a search before its first iteration.
Ereps first_search(const BallInCup& task, std::uint64_t seed);

/// One execution of a policy.
struct Execution {
  std::uint64_t seed = 0;    ///< of the world's noise
  BallVerdict verdict;       ///< from the series alone; not judged after a failure
  double reward = 0.0;       ///< the paper's, of what happened, at the ε that was learned with
  double reward_wide = 0.0;  ///< at ε = 0.055, the scale of the paper's figures
  std::string failure = {};  ///< of the world's solver, or the limit that the motion breaks
  RolloutTrace trace;        ///< with this reward, and success() as solved
  /// Whether the ball ended in the cup, without a failure of the robot.
  bool success() const { return failure.empty() && verdict.outcome == Outcome::kInCup; }
};

/// Executes the mean of a policy in a world. A motion that breaks a limit is not executed: that is
/// the failure, with the reward that Rollouts::run has for it.
/// @param world  with the policy's joints, ball and cup
/// @throws DataError naming the joint that starts beyond its range
Execution execute(const LearnedPolicy& policy, const Simulator& world, const MotionLimits& limits,
                  const CupSpec& cup, std::uint64_t seed, const SuccessOptions& options = {});

/// What the mean of a policy asks of all joints, to record it: the start is held for `still` [s]
/// before, which the joints' smoothing needs. Accelerations are differences of the velocities.
/// @param rate  of the rows [Hz]  @throws Error if the rate is not positive, or still is negative
Trajectory desired_motion(const LearnedPolicy& policy, double rate, double still = 1.0);

/// Ranges of the model's joints in their order.
MotionLimits motion_limits(const Model& model);

}  // namespace diffnea
