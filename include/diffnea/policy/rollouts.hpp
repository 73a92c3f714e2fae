#pragma once
/// Motions of a primitive executed in a simulator, many at once, and what a task says of them. What
/// one rollout is worth never depends on the others, nor on how many threads there are.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <diffnea/policy/promp.hpp>
#include <diffnea/policy/task.hpp>
#include <diffnea/sim/simulator.hpp>

namespace diffnea {

/// Range of a joint's desired position, and its largest velocity; ±∞ is none. [rad, rad/s], [m,
/// m/s]
struct MotionLimits {
  VecX<double> lower;     ///< (joints of the simulator) least position
  VecX<double> upper;     ///< (joints of the simulator) largest position
  VecX<double> velocity;  ///< (joints of the simulator) largest |q̇|
};

/// Where the first motion that breaks a limit does so.
struct LimitViolation {
  std::string joint;      ///< of the primitive
  double time = 0.0;      ///< [s]
  double value = 0.0;     ///< what is desired then: [rad] or [m], of a velocity [rad/s] or [m/s]
  double bound = 0.0;     ///< the limit on that side, as `value`
  bool velocity = false;  ///< both are velocities; false: positions
};

/// Rewards and outcomes of many trials.
struct RolloutResult {
  VecX<double> rewards;  ///< (N)
  /// (N); empty if the task has no such notion, or nothing was executed.
  std::vector<char> solved;
  std::vector<std::string> failures;  ///< (N), empty where none
};

/// A rollout kept row by row, until its episode ended. No rows if the motion breaks a limit.
struct RolloutTrace {
  VecX<double> time;                  ///< (T) [s]
  std::vector<std::string> channels;  ///< as the simulator's
  RowMatX<double> values;             ///< (T × channels)
  RowMatX<double> q_desired;          ///< (T × joints)
  double reward = 0.0;                ///< as Rollouts::run gives it
  bool solved = false;                ///< the task's word; false if it has no such notion
  std::string failure;                ///< of the simulator, or the limit that the motion breaks
};

/// Many trials of movements in one simulator.
class Rollouts {
 public:
  /// @param start  q_0 of the simulator's joints [rad, m]
  /// @throws Error if the primitive names a joint that the simulator has not, or there are no
  /// threads; ShapeError
  Rollouts(const Simulator& simulator, const Task& task, Promp promp, VecX<double> start,
           MotionLimits limits, int threads = 1);

  /// One rollout a row of theta. A motion that breaks a limit is not executed; its reward is −1 −
  /// Σ, summed over joints, of the largest excess of position [rad, m] and velocity [rad/s, m/s]. A
  /// simulator's failure is −∞, and its text.
  /// @param theta (N × parameters)
  /// @param seeds  (N) of each world's noise; empty: 0 for all
  /// @throws ShapeError; DataError if a parameter is not finite; what simulator and task throw
  RolloutResult run(const RowMatX<double>& theta, const std::vector<std::uint64_t>& seeds = {});
  /// One rollout with all that was seen.
  RolloutTrace trace(const VecX<double>& theta, std::uint64_t seed = 0);
  /// The first limit that the motion breaks.
  std::optional<LimitViolation> violation(const VecX<double>& theta) const;

  /// The movement primitive of the trials.
  const Promp& promp() const { return promp_; }
  /// (n) where every movement begins [rad, m].
  const VecX<double>& start() const { return start_; }
  long count() const { return count_; }  ///< rollouts executed so far

 private:
  struct Worker {
    std::unique_ptr<Simulator> simulator;
    std::unique_ptr<Task> task;
  };

  /// Desired motion at instant k of every lane's weights, (parameters × lanes).
  void command(long k, const Lanes& weights, Lanes& q, Lanes& qd) const;
  VecX<double> excess(const Lanes& weights) const;  ///< (lanes), 0 within the limits
  /// Rows of theta side by side; whether the task tells what it solved.
  /// @param trace  of the first, if given
  bool execute(Worker& worker, const RowMatX<double>& theta, std::span<const long> rows,
               const std::vector<std::uint64_t>& seeds, RolloutResult& out,
               RolloutTrace* trace = nullptr) const;

  Promp promp_;
  VecX<double> start_;
  MotionLimits limits_;
  long count_ = 0;
  std::vector<Worker> workers_;
  std::vector<int> rows_;        ///< of the primitive's joints among the simulator's
  double period_;                ///< between two instants [s]
  RowMatX<double> phi_, phi_d_;  ///< (steps + 1 × parameters per joint), of every instant
};

}  // namespace diffnea
