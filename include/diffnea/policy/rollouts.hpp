#pragma once
/// Motions of a primitive executed in a simulator, many at once, and what a task says of them.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/policy/promp.hpp>
#include <diffnea/policy/task.hpp>
#include <diffnea/sim/simulator.hpp>

namespace diffnea {

/// Range of a joint's desired position, and its largest velocity. [rad, rad/s], [m, m/s]
struct MotionLimits {
  VecX<double> lower, upper, velocity;  ///< (joints of the simulator)
};

/// Where the first motion that breaks a limit does so.
struct LimitViolation {
  std::string joint;
  double time = 0.0, value = 0.0, bound = 0.0;  ///< [s], [rad] or [rad/s]
  bool velocity = false;
};

struct RolloutResult {
  VecX<double> rewards;               ///< (N)
  std::vector<char> solved;           ///< (N); empty if the task has no such notion
  std::vector<std::string> failures;  ///< (N), empty where none
};

/// A rollout kept row by row.
struct RolloutTrace {
  VecX<double> time;                  ///< (T) [s]
  std::vector<std::string> channels;  ///< as the simulator's
  RowMatX<double> values;             ///< (T × channels)
  RowMatX<double> q_desired;          ///< (T × joints)
  double reward = 0.0;
  bool solved = false;
  std::string failure;
};

class Rollouts {
 public:
  /// @param start  q_0 of the simulator's joints [rad, m]
  /// @throws Error if the primitive names a joint that the simulator has not
  Rollouts(const Simulator& simulator, const Task& task, Promp promp, VecX<double> start,
           MotionLimits limits, int threads = 1);

  /// One rollout a row of theta. The reward of a motion that breaks a limit is −1 less by how far,
  /// and it is not executed. A simulator's failure is −∞.
  /// @param seeds  of each world's noise; empty: 0 for all
  RolloutResult run(const RowMatX<double>& theta, const std::vector<std::uint64_t>& seeds = {});
  /// One rollout with all that was seen.
  RolloutTrace trace(const VecX<double>& theta, std::uint64_t seed = 0);
  /// The first limit that the motion breaks.
  std::optional<LimitViolation> violation(const VecX<double>& theta) const;

  const Promp& promp() const { return promp_; }
  const VecX<double>& start() const { return start_; }
  long count() const { return count_; }  ///< rollouts executed so far

 private:
  Promp promp_;
  VecX<double> start_;
  MotionLimits limits_;
  long count_ = 0;
  struct Worker {
    std::unique_ptr<Simulator> simulator;
    std::unique_ptr<Task> task;
  };
  std::vector<Worker> workers_;
  std::vector<int> rows_;        ///< of the primitive's joints among the simulator's
  RowMatX<double> phi_, phi_d_;  ///< (steps × parameters per joint)
};

}  // namespace diffnea
