/// Ball in a cup: learned in the model, executed in a world that is not the model.

#include <atomic>
#include <chrono>
#include <future>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/experiment/ball_in_cup.hpp>
#include <diffnea/experiment/seeds.hpp>
#include <diffnea/io/ball_network_file.hpp>
#include <diffnea/io/policy_file.hpp>
#include <diffnea/io/policy_result.hpp>
#include <diffnea/io/result_folder.hpp>
#include <diffnea/io/world.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/version.hpp>

#include "bindings.hpp"
#include "control_law.hpp"
#include "ereps_history.hpp"
#include "rollout_set.hpp"
#include "value_type.hpp"

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
  c.law = choice("learn: law", law, kLaws);
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
LearnRun run_of(const BallInCup& task, std::vector<LearnedPolicy> policies, int threads,
                double seconds, bool interrupted) {
  LearnRun run;
  run.task = task;
  run.threads = threads;
  run.seconds = seconds;
  run.interrupted = interrupted;
  run.reproduce.version = version();
  run.reproduce.command = {"diffnea.learn"};
  if (std::filesystem::exists(task.model.source))
    run.reproduce.inputs.push_back(describe_input("model", task.model.source));
  Rollouts imagine = rollouts(task, 1);
  for (const LearnedPolicy& policy : policies)
    run.imagined.push_back(imagine.trace(policy.policy.mean));
  run.policies = std::move(policies);
  return run;
}

void bind_task(py::module_& m) {
  py::class_<BallInCup> c(m, "_BallInCup");
  c.def(py::init(&make_task), "model"_a, "controller"_a, "string"_a, "joints"_a, "start"_a,
        "promp"_a, "search"_a, "weight_std"_a, "reward"_a, "law"_a, "rate"_a, "bandwidth"_a,
        "damping"_a, "kp"_a, "kd"_a, "robust"_a, "ball_network"_a)
      .def_property_readonly("model", [](const BallInCup& t) { return t.model; })
      .def_property_readonly("joints", [](const BallInCup& t) { return t.options.promp.joints; })
      .def_property_readonly("start", [](const BallInCup& t) { return array_out(t.start); })
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
          [](const BallInCup& t, const std::vector<LearnedPolicy>& policies, int threads,
             double seconds, bool interrupted) {
            return parse_json(
                learn_result_json(run_of(t, policies, threads, seconds, interrupted)));
          },
          "policies"_a, "threads"_a, "seconds"_a, "interrupted"_a)
      .def(
          "save",
          [](const BallInCup& t, const std::filesystem::path& path,
             const std::vector<LearnedPolicy>& policies, int threads, double seconds,
             bool interrupted) {
            ResultFolder folder(path);
            publish_learn_run(run_of(t, policies, threads, seconds, interrupted), folder);
          },
          "folder"_a, "policies"_a, "threads"_a, "seconds"_a, "interrupted"_a,
          py::call_guard<py::gil_scoped_release>());
  m.def("_learn", &learn_python, "task"_a, "seeds"_a, "threads"_a, "progress"_a);
}

py::dict controller_out(const ControllerOptions& c) {
  static_assert(detail::field_count<ControllerOptions>() == 7, "name the new field here");
  py::dict out;
  out["law"] = law_name(c.law);
  out["rate"] = c.control_rate;
  out["kp"] = array_out(c.kp);
  out["kd"] = array_out(c.kd);
  out["bandwidth"] = c.bandwidth;
  out["damping"] = c.damping;
  out["gravity_compensation"] = c.gravity_compensation;
  return out;
}

ControllerOptions controller_in(const py::dict& d) {
  return {choice("Policy: law", py::cast<std::string>(d["law"]), kLaws),
          py::cast<double>(d["rate"]),
          vector_in("Policy: kp", d["kp"]),
          vector_in("Policy: kd", d["kd"]),
          py::cast<double>(d["bandwidth"]),
          py::cast<double>(d["damping"]),
          py::cast<bool>(d["gravity_compensation"])};
}

py::dict reward_out(const BallInCupOptions& o) {
  static_assert(detail::field_count<BallInCupOptions>() == 5, "name the new field here");
  py::dict out;
  out["epsilon"] = o.epsilon;
  out["lambda_q"] = o.lambda_q;
  out["lambda_qd"] = o.lambda_qd;
  out["lambda_slack"] = o.lambda_slack;
  out["string"] = o.string;
  return out;
}

py::tuple policy_state(const LearnedPolicy& p) {
  static_assert(detail::field_count<LearnedPolicy>() == 15, "name the new field here");
  return py::make_tuple(p.seed, Promp(p.promp), p.policy, p.joints, array_out(p.start),
                        controller_out(p.controller), reward_out(p.reward), history_out(p.curve),
                        p.stopped, p.expected, p.solved, p.rollouts, p.seconds,
                        py::make_tuple(p.in_draws.count, p.in_draws.caught, p.in_draws.reward),
                        p.ball_network.file, p.ball_network.sha256);
}

LearnedPolicy policy_from(const py::tuple& s) {
  const py::dict r = s[6];
  const auto [count, caught, reward] = py::cast<std::tuple<int, int, double>>(s[13]);
  return {.seed = py::cast<std::uint64_t>(s[0]),
          .promp = py::cast<const Promp&>(s[1]).spec(),
          .policy = py::cast<Gaussian>(s[2]),
          .joints = py::cast<std::vector<std::string>>(s[3]),
          .start = vector_in("Policy", s[4]),
          .controller = controller_in(s[5]),
          .reward = {py::cast<double>(r["epsilon"]), py::cast<double>(r["lambda_q"]),
                     py::cast<double>(r["lambda_qd"]), py::cast<double>(r["lambda_slack"]),
                     py::cast<double>(r["string"])},
          .curve = history_in(s[7]),
          .stopped = py::cast<std::string>(s[8]),
          .expected = py::cast<double>(s[9]),
          .solved = py::cast<bool>(s[10]),
          .rollouts = py::cast<long>(s[11]),
          .seconds = py::cast<double>(s[12]),
          .in_draws = {count, caught, reward},
          .ball_network = {py::cast<std::string>(s[14]), py::cast<std::string>(s[15])}};
}

/// Desired positions and velocities of all joints, (T × n).
py::tuple motion(const LearnedPolicy& p, const py::object& times, const py::object& theta) {
  const VecX<double> t = vector_in("Policy.motion: times", times);
  RowMatX<double> moved, moved_d;
  Promp(p.promp).motion(theta.is_none() ? p.policy.mean : vector_in("Policy.motion: theta", theta),
                        t, moved, moved_d);
  RowMatX<double> q = p.start.transpose().replicate(t.size(), 1);
  RowMatX<double> qd = RowMatX<double>::Zero(t.size(), p.start.size());
  for (std::size_t j = 0; j < p.promp.joints.size(); ++j) {
    const long column = std::ranges::find(p.joints, p.promp.joints[j]) - p.joints.begin();
    q.col(column) += moved.col(static_cast<long>(j));
    qd.col(column) = moved_d.col(static_cast<long>(j));
  }
  return py::make_tuple(array_out(q), array_out(qd));
}

std::string policy_repr(const LearnedPolicy& p) {
  char text[160];
  std::snprintf(text, sizeof text,
                "%d weights, %zu iterations, %ld rollouts; reward of the mean %.3f",
                p.policy.size(), p.curve.size(), p.rollouts, p.expected);
  const std::string draws = p.in_draws.count == 0
                                ? ""
                                : ", in " + std::to_string(p.in_draws.caught) + " of " +
                                      std::to_string(p.in_draws.count) + " draws";
  return "Policy(seed " + std::to_string(p.seed) + ": " + (p.solved ? "solved" : "not solved") +
         " in the model" + draws + "; " + text + (p.stopped.empty() ? "; interrupted)" : ")");
}

void bind_learned_policy(py::module_& m) {
  using P = LearnedPolicy;
  py::class_<P> c(m, "Policy", "A learned movement: a Gaussian over the weights of a primitive.");
  c.def_readonly("seed", &P::seed, "Of the search.")
      .def_property_readonly(
          "promp", [](const P& p) { return Promp(p.promp); }, "The :class:`Promp`.")
      .def_property_readonly(
          "gaussian", [](const P& p) { return p.policy; }, "The :class:`Gaussian`.")
      .def_property_readonly(
          "mean", [](const P& p) { return array_out(p.policy.mean); },
          "(d,) weights that are executed.")
      .def_property_readonly(
          "covariance", [](const P& p) { return array_out(RowMatX<double>(p.policy.covariance)); },
          "(d, d)")
      .def_readonly("joints", &P::joints, "All joints of the robot.")
      .def_property_readonly(
          "start", [](const P& p) { return array_out(p.start); }, "(n,) q_0 of all joints [rad].")
      .def_property_readonly(
          "controller", [](const P& p) { return controller_out(p.controller); },
          "Law, rate and gains as they were simulated.")
      .def_property_readonly(
          "reward", [](const P& p) { return reward_out(p.reward); }, "Options of the reward.")
      .def_property_readonly(
          "curve", [](const P& p) { return history_out(p.curve); },
          "Arrays by name, one entry an iteration of the search.")
      .def_readonly("stopped", &P::stopped, "Why the search ended; empty: it was interrupted.")
      .def_readonly("expected", &P::expected, "Reward of the mean in the model.")
      .def_readonly("solved", &P::solved, "The mean catches the ball in the model.")
      .def_property_readonly(
          "caught_share",
          [](const P& p) {
            return p.in_draws.count > 0
                       ? py::cast(static_cast<double>(p.in_draws.caught) / p.in_draws.count)
                       : py::object(py::none());
          },
          "Share of draws of the posterior, which the search had not seen, in which the mean "
          "catches the ball; None: it was learned in the model alone.")
      .def_readonly("rollouts", &P::rollouts, "That it took.")
      .def_readonly("seconds", &P::seconds, "That it took.")
      .def_property_readonly(
          "ball_network",
          [](const P& p) -> py::object {
            if (p.ball_network.sha256.empty()) return py::none();
            return py::dict("file"_a = p.ball_network.file, "sha256"_a = p.ball_network.sha256);
          },
          "``file`` and ``sha256`` of the network that moved the ball there; None: there was none.")
      .def("motion", &motion, "times"_a, "theta"_a = py::none(),
           "Desired positions [rad] and velocities [rad/s] of all joints at ``times`` (T,) [s]: "
           "(T, n) each.\n\n``theta`` (d,): other weights than the mean.")
      .def(
          "sample",
          [](const P& p, int count, std::uint64_t seed) {
            if (count < 0) throw Error("Policy.sample: count: got a negative number");
            Rng rng(seed);
            return array_out(p.policy.sample(count, rng));
          },
          "count"_a, py::kw_only(), "seed"_a = 0, "(count, d) weights.")
      .def(
          "to_dict", [](const P& p) { return parse_json(policy_json(p)); },
          "The policy as dict, schema ``diffnea/policy/1``.")
      .def(
          "save", [](const P& p, const std::filesystem::path& path) { write_policy(p, path); },
          "path"_a, py::call_guard<py::gil_scoped_release>(),
          "Write the JSON file that :func:`read_policy` reads.")
      .def("__repr__", &policy_repr)
      .def(py::pickle(&policy_state, &policy_from));
  c.attr("__module__") = "diffnea";
  m.def("read_policy", &read_policy, "path"_a, py::call_guard<py::gil_scoped_release>(),
        "Read a policy that :meth:`Policy.save`, or ``diffnea learn``, wrote.");
}

/// A world that policies are executed in.
struct World {
  std::unique_ptr<Simulator> quiet, noisy;
  MotionLimits limits;
  CupSpec cup;
  WorldSpec spec;
  Model controller;
  std::uint64_t seed = 0;
};

World make_world(const std::string& name, const Model& controller, const LearnedPolicy& policy,
                 std::optional<double> nominal_string, std::uint64_t seed, double position_noise,
                 double torque_noise, double posture_noise) {
  if (!controller.cup) throw ModelError("transfer: the controller's model has no cup");
  WorldSpec spec = parse_world(name);
  if (nominal_string && !spec.string && !spec.nominal_string) spec.nominal_string = nominal_string;
  MujocoSimulatorOptions quiet;
  quiet.controller = policy.controller;
  MujocoSimulatorOptions noisy = quiet;
  noisy.position_noise = position_noise;
  noisy.torque_noise = torque_noise;
  noisy.encoder_noise = posture_noise;
  return {make_simulator(spec, controller, quiet, seed),
          make_simulator(spec, controller, noisy, seed),
          motion_limits(controller),
          *controller.cup,
          spec,
          controller,
          seed};
}

Recording record_python(const World& world, const LearnedPolicy& policy) {
  SimulatedRecording seen;
  {
    const py::gil_scoped_release release;
    RecordOptions options;
    static_cast<ControllerOptions&>(options) = policy.controller;
    options.scale_noise(world.spec.noise);
    seen = record_in_world(world.spec, world.controller,
                           desired_motion(policy, options.control_rate), options, world.seed,
                           /*threads=*/1, policy.seed)
               .result;
  }
  if (!seen.failure.empty()) {
    const std::string text = "transfer: the recording of policy " + std::to_string(policy.seed) +
                             " ended early: " + seen.failure;
    if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) throw py::error_already_set();
  }
  return std::move(seen.recording);
}

/// seed, outcome, text, reward, reward_wide, failure, trace
py::tuple execute_python(const World& world, const LearnedPolicy& policy, bool noisy,
                         std::uint64_t seed) {
  Execution out;
  {
    const py::gil_scoped_release release;
    out = execute(policy, noisy ? *world.noisy : *world.quiet, world.limits, world.cup, seed);
  }
  return py::make_tuple(out.seed, outcome_word(out), out.verdict.text, out.reward, out.reward_wide,
                        out.failure, trace_out(out.trace));
}

void bind_transfer(py::module_& m) {
  py::class_<World> c(m, "_World");
  c.def(py::init(&make_world), "name"_a, "controller"_a, "policy"_a, "nominal_string"_a, "seed"_a,
        "position_noise"_a, "torque_noise"_a, "posture_noise"_a)
      .def("execute", &execute_python, "policy"_a, "noisy"_a, "seed"_a)
      .def("record", &record_python, "policy"_a);
  m.def(
      "_world_simulator",
      [](const std::string& name, const Model& controller, std::uint64_t seed, int lanes,
         double bandwidth, const py::object& kp, const py::object& kd) {
        MujocoSimulatorOptions options;
        options.lanes = lanes;
        options.controller.bandwidth = bandwidth;
        options.controller.kp = optional_vector("world_simulator: kp", kp);
        options.controller.kd = optional_vector("world_simulator: kd", kd);
        return make_simulator(parse_world(name), controller, options, seed);
      },
      "name"_a, "controller"_a, "seed"_a, "lanes"_a, "bandwidth"_a, "kp"_a, "kd"_a);
  m.def("_world_file", [](const std::string& name) { return parse_world(name).mjcf; }, "name"_a);
}

}  // namespace

void bind_experiment(py::module_& m) {
  bind_task(m);
  bind_learned_policy(m);
  bind_transfer(m);
}

}  // namespace diffnea::python
