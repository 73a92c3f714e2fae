#include "python_world.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/ball_in_cup.hpp>

#include "arrays.hpp"
#include "bindings.hpp"

namespace diffnea::python {
namespace {

/// A flag a world. @throws ShapeError naming `what`
std::vector<char> flags_in(const char* what, const py::object& x, int count) {
  const auto flags = py::array_t < bool, py::array::c_style | py::array::forcecast > ::ensure(x);
  if (!flags || flags.ndim() != 1 || flags.shape(0) != count)
    throw ShapeError(std::string(what) + ": got " +
                     (flags ? "shape " + shape_text(flags) : std::string(py::repr(x))) +
                     ", expected one boolean a world, (" + std::to_string(count) + ",)");
  return {flags.data(), flags.data() + count};
}

py::array_t<bool> flags_out(const std::vector<char>& flags) {
  py::array_t<bool> out(static_cast<py::ssize_t>(flags.size()));
  std::copy(flags.begin(), flags.end(), out.mutable_data());
  return out;
}

/// What a task is told of a simulator.
py::object info(const Simulator& simulator) {
  return python_function("diffnea._policy", "SimulatorInfo")(
      py::tuple(py::cast(simulator.joints())), py::tuple(py::cast(simulator.channels())),
      simulator.period(), simulator.lanes());
}

py::dict channel_rows(const Simulator& simulator) {
  py::dict out;
  int row = 0;
  for (const std::string& channel : simulator.channels()) out[py::str(channel)] = row++;
  return out;
}

/// The worlds that run, by channel; a copy that may be kept.
py::object observation_out(const Held& rows, const Lanes& observation, long count) {
  return python_function("diffnea._policy", "Observation")(
      *rows, array_out(RowMatX<double>(observation.leftCols(count))));
}

void end_more(const std::vector<char>& more, std::vector<char>& ended) {
  for (std::size_t i = 0; i < ended.size(); ++i) ended[i] = ended[i] || more[i];
}

}  // namespace

Held hold(py::object object) {
  return Held(new py::object(std::move(object)), [](py::object* held) {
    const py::gil_scoped_acquire gil;
    delete held;
  });
}

PythonSimulator::PythonSimulator(const py::object& self)
    : self_(hold(self)),
      joints_(py::cast<std::vector<std::string>>(self.attr("joints"))),
      channels_(py::cast<std::vector<std::string>>(self.attr("channels"))),
      period_(py::cast<double>(self.attr("period"))),
      lanes_(py::cast<int>(self.attr("lanes"))),
      observed_(Lanes::Zero(static_cast<long>(channels_.size()), lanes_)) {
  if (!(period_ > 0.0) || lanes_ < 1 || joints_.empty() || channels_.empty())
    throw Error("Simulator: " + std::to_string(joints_.size()) + " joints, " +
                std::to_string(channels_.size()) + " channels, " + std::to_string(lanes_) +
                " lanes and a period of " + std::to_string(period_) +
                " s; expected at least one of each, and a period above 0");
}

void PythonSimulator::look() {
  observed_ = matrix_in("Simulator.observe", self_->attr("observe")(),
                        static_cast<long>(channels_.size()), lanes_);
  failures_ = py::cast<std::vector<std::string>>(self_->attr("failures")());
  if (!failures_.empty())
    require_size("Simulator.failures", static_cast<long>(failures_.size()), lanes_, "lane");
}

void PythonSimulator::reset(const Starts& starts) {
  const py::gil_scoped_acquire gil;
  self_->attr("reset")(array_out(starts.q),
                       py::array_t<std::uint64_t>(static_cast<py::ssize_t>(starts.seeds.size()),
                                                  starts.seeds.data()));
  look();
}

void PythonSimulator::step(const Lanes& q, const Lanes& qd) {
  const py::gil_scoped_acquire gil;
  self_->attr("step")(array_out(q), array_out(qd));
  look();
}

std::unique_ptr<Simulator> PythonSimulator::clone() const {
  const py::gil_scoped_acquire gil;
  return std::make_unique<PythonSimulator>(self_->attr("clone")());
}

void PythonTask::begin(const Simulator& simulator, int count) {
  const py::gil_scoped_acquire gil;
  rows_ = hold(channel_rows(simulator));
  count_ = count;
  self_->attr("begin")(info(simulator), count);
}

void PythonTask::look(double time, const Lanes& observation, std::vector<char>& ended) {
  const py::gil_scoped_acquire gil;
  const py::array_t<bool> flags = flags_out(ended);
  self_->attr("look")(time, observation_out(rows_, observation, count_), flags);
  end_more({flags.data(), flags.data() + flags.size()}, ended);
}

VecX<double> PythonTask::rewards() const {
  const py::gil_scoped_acquire gil;
  return vector_in("Task.rewards", self_->attr("rewards")(), count_);
}

std::vector<char> PythonTask::solved() const {
  if (count_ == 0) return {};
  const py::gil_scoped_acquire gil;
  const py::object out = self_->attr("solved")();
  return out.is_none() ? std::vector<char>{} : flags_in("Task.solved", out, count_);
}

std::unique_ptr<Task> PythonTask::clone() const {
  const py::gil_scoped_acquire gil;
  return std::make_unique<PythonTask>(self_->attr("clone")());
}

void RecordingTask::begin(const Simulator& simulator, int count) {
  if (inner_) inner_->begin(simulator, count);
  looks_.clear();
  length_.assign(static_cast<std::size_t>(count), 0);
  if (!ended_) return;
  const py::gil_scoped_acquire gil;
  rows_ = hold(channel_rows(simulator));
}

void RecordingTask::look(double time, const Lanes& observation, std::vector<char>& ended) {
  const long count = static_cast<long>(length_.size());
  looks_.emplace_back(observation.leftCols(count));
  for (std::size_t i = 0; i < length_.size(); ++i) length_[i] += ended[i] ? 0 : 1;
  if (inner_) inner_->look(time, observation, ended);
  if (!ended_) return;
  const py::gil_scoped_acquire gil;
  end_more(flags_in("ended", (*ended_)(observation_out(rows_, observation, count)),
                    static_cast<int>(count)),
           ended);
}

VecX<double> RecordingTask::rewards() const {
  VecX<double> places(static_cast<long>(length_.size()));
  const std::lock_guard<std::mutex> lock(store_->mutex);
  for (std::size_t i = 0; i < length_.size(); ++i) {
    RowMatX<double> rollout(looks_.front().rows(), length_[i]);
    for (long t = 0; t < length_[i]; ++t)
      rollout.col(t) = looks_[static_cast<std::size_t>(t)].col(static_cast<long>(i));
    places[static_cast<long>(i)] = static_cast<double>(store_->rollouts.size());
    store_->rollouts.push_back(std::move(rollout));
  }
  return places;
}

std::vector<char> RecordingTask::solved() const {
  return inner_ ? inner_->solved() : std::vector<char>{};
}

std::unique_ptr<Task> RecordingTask::clone() const {
  return std::make_unique<RecordingTask>(inner_ ? inner_->clone() : nullptr, ended_, store_);
}

std::unique_ptr<Simulator> simulator_of(const py::object& simulator) {
  if (py::isinstance<Simulator>(simulator)) return py::cast<const Simulator&>(simulator).clone();
  return std::make_unique<PythonSimulator>(simulator);
}

std::unique_ptr<Task> task_of(const py::object& task) {
  if (py::isinstance<BallInCupTask>(task)) return py::cast<const BallInCupTask&>(task).clone();
  return std::make_unique<PythonTask>(task);
}

}  // namespace diffnea::python
