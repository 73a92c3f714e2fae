#pragma once
/// Simulators and tasks that are written in Python, and rollouts that are kept whole. The library's
/// threads hold no GIL: every one of these takes it for as long as it is in Python.

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>

#include <diffnea/policy/task.hpp>
#include <diffnea/sim/simulator.hpp>

namespace diffnea::python {

namespace py = pybind11;

/// A Python object that may be dropped by a thread without the GIL.
using Held = std::shared_ptr<py::object>;
Held hold(py::object object);

/// An object with the attributes and methods of diffnea.Simulator.
class PythonSimulator : public Simulator {
 public:
  /// @throws Error naming the attribute that makes no sense
  explicit PythonSimulator(const py::object& self);

  const std::vector<std::string>& joints() const override { return joints_; }
  const std::vector<std::string>& channels() const override { return channels_; }
  double period() const override { return period_; }
  int lanes() const override { return lanes_; }
  void reset(const Starts& starts) override;
  void step(const Lanes& q, const Lanes& qd) override;
  const Lanes& observe() const override { return observed_; }
  const std::vector<std::string>& failures() const override { return failures_; }
  std::unique_ptr<Simulator> clone() const override;

 private:
  void look();  ///< with the GIL

  Held self_;
  std::vector<std::string> joints_, channels_, failures_;
  double period_ = 0.0;
  int lanes_ = 0;
  Lanes observed_;
};

/// An object with the methods of diffnea.Task.
class PythonTask : public Task {
 public:
  explicit PythonTask(py::object self) : self_(hold(std::move(self))) {}

  void begin(const Simulator& simulator, int count) override;
  void look(double time, const Lanes& observation, std::vector<char>& ended) override;
  VecX<double> rewards() const override;
  std::vector<char> solved() const override;
  std::unique_ptr<Task> clone() const override;

 private:
  Held self_, rows_;  ///< the object; numbers of the channels by name
  int count_ = 0;
};

/// Rollouts of a batch in the order in which they ended.
struct RolloutStore {
  std::mutex mutex;
  std::vector<RowMatX<double>> rollouts;  ///< (channels × rows) each
};

/// Keeps all that is seen. A rollout's reward is its place in the store.
class RecordingTask : public Task {
 public:
  /// @param inner  decides when an episode ends and what is solved; null: nothing ends
  /// @param ended  a function of an observation, which ends episodes, too; null: none
  RecordingTask(std::unique_ptr<Task> inner, Held ended, std::shared_ptr<RolloutStore> store)
      : inner_(std::move(inner)), ended_(std::move(ended)), store_(std::move(store)) {}

  void begin(const Simulator& simulator, int count) override;
  void look(double time, const Lanes& observation, std::vector<char>& ended) override;
  VecX<double> rewards() const override;
  std::vector<char> solved() const override;
  std::unique_ptr<Task> clone() const override;

 private:
  std::unique_ptr<Task> inner_;
  Held ended_, rows_;
  std::shared_ptr<RolloutStore> store_;
  std::vector<Lanes> looks_;
  std::vector<long> length_;  ///< looks at each world while its episode went on
};

/// A copy of what the library or Python offers as a simulator or a task.
std::unique_ptr<Simulator> simulator_of(const py::object& simulator);
std::unique_ptr<Task> task_of(const py::object& task);

}  // namespace diffnea::python
