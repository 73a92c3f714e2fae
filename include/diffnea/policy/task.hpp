#pragma once
/// A task: what a motion is worth, computed from what a simulator shows, and when it is over. Own
/// tasks derive from Task; sim/simulator.hpp says what the channels are.

#include <memory>
#include <vector>

#include <diffnea/sim/simulator.hpp>

namespace diffnea {

/// What a trial is worth; implement it for a task of your own.
class Task {
 public:
  virtual ~Task() = default;

  /// Before the first look of every batch. @throws Error if the simulator lacks a channel
  virtual void begin(const Simulator& simulator, int count) = 0;
  /// One look at every world, the first at the start, then after every step.
  /// @param ended  (count) set to 1 where the episode is over; never looked at again there
  virtual void look(double time, const Lanes& observation, std::vector<char>& ended) = 0;
  /// Rewards of the batch, (count). Minus infinity: never again; NaN is an error of the task's.
  virtual VecX<double> rewards() const = 0;
  /// 1 where the task was done (a ball in the cup), (count); empty where a task has no such notion.
  virtual std::vector<char> solved() const { return {}; }
  /// Another one like it, for another thread.
  virtual std::unique_ptr<Task> clone() const = 0;
};

}  // namespace diffnea
