/// Ball in a cup, learned in the model.

#include <atomic>
#include <chrono>
#include <future>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/experiment/ball_in_cup.hpp>
#include <diffnea/experiment/seeds.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/runs/ball_network_file.hpp>
#include <diffnea/runs/policy_result.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/version.hpp>

#include "bindings.hpp"
#include "choice.hpp"
#include "data.hpp"
#include "ereps_history.hpp"
#include "rollout_set.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// {}: for the model alone.
RobustOptions robust_in(const py::dict& d) {
  RobustOptions out;
  if (d.empty()) return out;
  out.draws = py::cast<int>(d["draws"]);
  out.each = py::cast<int>(d["each"]);
  if (!d["quantile"].is_none()) out.quantile = py::cast<double>(d["quantile"]);
  for (const auto& [parameter, range] : py::dict(d["vary"])) {
    const auto [low, high] = py::cast<std::pair<double, double>>(range);
    out.vary.push_back({py::cast<std::string>(parameter), low, high});
    if (!(low <= high))
      throw Error("learn: vary: " + out.vary.back().parameter + ": got " + std::to_string(low) +
                  " to " + std::to_string(high) +
                  ", expected a low end that is not above the high one");
  }
  return out;
}

BallInCup make_task(const Model& model, const Model& controller, std::optional<double> string,
                    const std::vector<std::string>& joints, const py::object& start,
                    const py::dict& promp, const ErepsOptions& search, double weight_std,
                    const py::dict& reward, const std::string& law, double rate, double bandwidth,
                    double damping, const py::object& kp, const py::object& kd,
                    const py::dict& robust, const std::shared_ptr<BallNetwork>& ball_network) {
  LearnOptions o;
  o.simulator.ball_network = ball_network;
  o.joints = joints;
  o.start = optional_vector("learn: start", start);
  o.promp.bases = py::cast<int>(promp["bases"]);
  o.promp.duration = py::cast<double>(promp["duration"]);
  o.promp.hold = py::cast<double>(promp["hold"]);
  o.ereps = search;
  o.weight_std = weight_std;
  o.nominal_string = string.value_or(0.0);
  o.reward.epsilon = py::cast<double>(reward["epsilon"]);
  o.reward.lambda_q = py::cast<double>(reward["lambda_q"]);
  o.reward.lambda_qd = py::cast<double>(reward["lambda_qd"]);
  o.reward.lambda_slack = py::cast<double>(reward["lambda_slack"]);
  ControllerOptions& c = o.simulator.controller;
  c.law = choice<ControlLaw>("learn: law", law);
  c.control_rate = rate;
  c.bandwidth = bandwidth;
  c.damping = damping;
  c.kp = optional_vector("learn: kp", kp);
  c.kd = optional_vector("learn: kd", kd);
  o.robust = robust_in(robust);
  return ball_in_cup(model, controller, std::move(o));
}

/// Searches from all seeds, on threads of the library's own; this one looks out for Ctrl-C.
/// @param progress  called (seed, last entries of the history) after every iteration; False: stop
std::vector<LearnedPolicy> learn_python(const BallInCup& task,
                                        const std::vector<std::uint64_t>& seeds, int threads,
                                        const py::object& progress) {
  if (threads < 1)
    throw Error("learn: threads: got " + std::to_string(threads) + ", expected 1 or more");
  std::atomic<bool> stop = false;
  std::exception_ptr raised;
  SeedHooks hooks;
  hooks.iterated = [&](std::uint64_t seed, const SearchState& state) {
    if (progress.is_none() || stop) return !stop;
    const py::gil_scoped_acquire gil;
    try {
      const ErepsIteration& last = state.search.history().back();
      if (progress(seed, last.iteration, last.reward_mean, last.solved_share).is(py::bool_(false)))
        stop = true;
    } catch (const py::error_already_set&) {
      if (!raised) raised = std::current_exception();
      stop = true;
    }
    return !stop;
  };
  std::vector<LearnedPolicy> out;
  {
    const py::gil_scoped_release release;
    std::future<std::vector<LearnedPolicy>> found =
        std::async(std::launch::async, [&] { return learn_seeds(task, seeds, threads, hooks); });
    while (found.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
      const py::gil_scoped_acquire gil;
      if (PyErr_CheckSignals() == 0) continue;
      PyErr_Clear();  // what was learned is returned
      stop = true;
    }
    out = found.get();
  }
  if (raised) std::rethrow_exception(raised);
  return out;
}

/// What a search that Python ran has found.
LearnedPolicy finished(const BallInCup& task, const Ereps& search, double expected, bool solved,
                       long rollouts, double seconds) {
  LearnedPolicy out = found_policy(task, search);
  out.expected = expected;
  out.solved = solved;
  out.rollouts = rollouts;
  out.seconds = seconds;
  return out;
}

/// What `diffnea learn` leaves.
LearnRun run_of(const BallInCup& task, std::vector<RunInput> inputs,
                std::vector<LearnedPolicy> policies, int threads, double seconds,
                bool interrupted) {
  LearnRun run;
  run.task = task;
  run.threads = threads;
  run.seconds = seconds;
  run.interrupted = interrupted;
  run.reproduce.version = version();
  run.reproduce.command = {"diffnea.learn"};
  run.reproduce.inputs = std::move(inputs);
  Rollouts imagine = rollouts(task, 1);
  for (const LearnedPolicy& policy : policies)
    run.imagined.push_back(imagine.trace(policy.policy.mean));
  run.policies = std::move(policies);
  return run;
}

}  // namespace

void bind_task(py::module_& m) {
  py::class_<BallInCup> c(m, "_BallInCup");
  c.def(py::init(&make_task), "model"_a, "controller"_a, "string"_a, "joints"_a, "start"_a,
        "promp"_a, "search"_a, "weight_std"_a, "reward"_a, "law"_a, "rate"_a, "bandwidth"_a,
        "damping"_a, "kp"_a, "kd"_a, "robust"_a, "ball_network"_a)
      .def_property_readonly("model", [](const BallInCup& t) { return t.model; })
      .def("search", &first_search, "seed"_a)
      .def(
          "rollouts",
          [](const BallInCup& t, const py::object& task, const py::object& ended, bool whole,
             int threads) {
            const ModelSimulator simulator({t.model}, t.controller, t.options.simulator);
            const py::object judge =
                task.is_none() ? py::cast(BallInCupTask(t.options.reward)) : task;
            return make_rollouts(simulator, Promp(t.options.promp), judge, ended, whole, t.start,
                                 motion_limits(t.model), threads);
          },
          "task"_a, "ended"_a, "whole"_a, "threads"_a)
      .def("finished", &finished, "search"_a, "expected"_a, "solved"_a, "rollouts"_a, "seconds"_a)
      .def(
          "to_dict",
          [](const BallInCup& t, const std::vector<RunInput>& inputs,
             const std::vector<LearnedPolicy>& policies, int threads, double seconds,
             bool interrupted) {
            return parse_json(
                learn_result_json(run_of(t, inputs, policies, threads, seconds, interrupted)));
          },
          "inputs"_a, "policies"_a, "threads"_a, "seconds"_a, "interrupted"_a)
      .def(
          "save",
          [](const BallInCup& t, const std::filesystem::path& path,
             const std::vector<RunInput>& inputs, const std::vector<LearnedPolicy>& policies,
             int threads, double seconds, bool interrupted) {
            check_run_folder(path, "learn");
            ResultFolder folder(path);
            publish_learn_run(run_of(t, inputs, policies, threads, seconds, interrupted), folder);
          },
          "folder"_a, "inputs"_a, "policies"_a, "threads"_a, "seconds"_a, "interrupted"_a,
          py::call_guard<py::gil_scoped_release>());
  m.def("_describe_model", &describe_model, "model"_a, py::call_guard<py::gil_scoped_release>());
  m.def("_learn", &learn_python, "task"_a, "seeds"_a, "threads"_a, "progress"_a);
}

}  // namespace diffnea::python
