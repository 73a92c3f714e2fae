/// Rollouts of primitives in any world: the library's simulators and tasks, and Python's.

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/ball_in_cup.hpp>
#include <diffnea/sim/model_simulator.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "choice.hpp"
#include "rollout_set.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

void bind_simulator(py::module_& m) {
  py::class_<Simulator, std::unique_ptr<Simulator>> c(
      m, "NativeSimulator",
      "A simulator of the library; has what :class:`Simulator` asks for, and may be used by one "
      "in Python.");
  c.def_property_readonly("joints", &Simulator::joints, "That are driven.")
      .def_property_readonly("channels", &Simulator::channels, "Names of the rows of ``observe``.")
      .def_property_readonly("period", &Simulator::period, "Between two commands [s].")
      .def_property_readonly("lanes", &Simulator::lanes, "Worlds side by side.")
      .def(
          "reset",
          [](Simulator& s, const py::object& q, const std::vector<std::uint64_t>& seeds) {
            Starts starts{matrix_in("reset: q", q, static_cast<long>(s.joints().size()), -1),
                          seeds};
            require_size("reset: seeds", static_cast<long>(seeds.size()), starts.q.cols(), "world");
            const py::gil_scoped_release release;
            s.reset(starts);
          },
          "q"_a, "seeds"_a, "Worlds at rest at ``q`` (joints, n), n ≤ lanes; ``seeds`` (n,).")
      .def(
          "step",
          [](Simulator& s, const py::object& q, const py::object& qd) {
            const long joints = static_cast<long>(s.joints().size());
            const Lanes to = matrix_in("step: q", q, joints, -1),
                        speed = matrix_in("step: qd", qd, joints, to.cols());
            if (to.cols() != s.lanes())
              throw ShapeError("step: q: got " + std::to_string(to.cols()) + " columns, expected " +
                               std::to_string(s.lanes()) + ", one a lane");
            const py::gil_scoped_release release;
            s.step(to, speed);
          },
          "q"_a, "qd"_a, "One period towards ``q``, ``qd`` (joints, lanes).")
      .def(
          "observe", [](const Simulator& s) { return array_out(s.observe()); },
          "(channels, lanes), a copy.")
      .def(
          "failures", [](const Simulator& s) { return s.failures(); },
          "Why a lane cannot go on, or empty texts, (lanes); or an empty list.")
      .def(
          "clone", [](const Simulator& s) { return s.clone(); }, "Another one like it.")
      .def(
          "__deepcopy__", [](const Simulator& s, const py::dict&) { return s.clone(); }, "memo"_a)
      .def("__repr__", [](const Simulator& s) {
        return "NativeSimulator(" + std::to_string(s.joints().size()) + " joints, " +
               std::to_string(s.channels().size()) + " channels, " + std::to_string(s.lanes()) +
               " lanes)";
      });
  c.attr("__module__") = "diffnea";
  const ModelSimulatorOptions o;
  m.def(
      "model_simulator",
      [](const Model& model, const Model* controller, const std::string& law, double rate,
         double bandwidth, double damping, const py::object& kp, const py::object& kd,
         double settle_time) -> std::unique_ptr<Simulator> {
        ModelSimulatorOptions options;
        options.controller.law = choice<ControlLaw>("model_simulator: law", law);
        options.controller.control_rate = rate;
        options.controller.bandwidth = bandwidth;
        options.controller.damping = damping;
        options.controller.kp = optional_vector("model_simulator: kp", kp);
        options.controller.kd = optional_vector("model_simulator: kd", kd);
        options.settle_time = settle_time;
        return std::make_unique<ModelSimulator>(std::vector<Model>{model},
                                                controller ? *controller : model, options);
      },
      "model"_a, py::kw_only(), "controller"_a = py::none(), "law"_a = "pd",
      "rate"_a = o.controller.control_rate, "bandwidth"_a = o.controller.bandwidth,
      "damping"_a = o.controller.damping, "kp"_a = py::none(), "kd"_a = py::none(),
      "settle_time"_a = o.settle_time,
      "The model as a world: the arm under its controller, and a ball on its string.\n\n"
      "``controller``: the model that the controller knows, default ``model``; ``law`` ``pd`` or\n"
      "``computed_torque``; gains ``kp``, ``kd`` (n,), or by ``bandwidth`` [rad/s] and "
      "``damping``;\n``settle_time`` that the start is held before time 0 [s].");
}

std::vector<std::uint64_t> seeds_in(const py::object& seeds) {
  return seeds.is_none() ? std::vector<std::uint64_t>{}
                         : py::cast<std::vector<std::uint64_t>>(seeds);
}

RowMatX<double> theta_in(const RolloutSet& set, const py::object& theta) {
  const py::array_t<double> a = number_array("Rollouts: theta", theta);
  if (a.ndim() != 2)
    throw ShapeError("Rollouts: theta: got shape " + shape_text(a) + ", expected (N, " +
                     std::to_string(set.rollouts->promp().size()) + ")");
  return matrix_in("Rollouts: theta", theta, a.shape(0), set.rollouts->promp().size());
}

py::object solved_out(const std::vector<char>& solved) {
  if (solved.empty()) return py::none();
  py::array_t<bool> out(static_cast<py::ssize_t>(solved.size()));
  std::copy(solved.begin(), solved.end(), out.mutable_data());
  return out;
}

/// rewards, solved, failures
py::tuple run(RolloutSet& set, const py::object& theta, const py::object& seeds) {
  const RowMatX<double> parameters = theta_in(set, theta);
  const std::vector<std::uint64_t> noise = seeds_in(seeds);
  RolloutResult out;
  {
    const py::gil_scoped_release release;
    out = set.rollouts->run(parameters, noise);
  }
  return py::make_tuple(array_out(out.rewards), solved_out(out.solved), out.failures);
}

/// rewards (of those that were not executed), solved, failures; of those that were: index (N), rows
/// (N), values (channels, N, T), the last row repeated where an episode ended early.
py::tuple record(RolloutSet& set, const py::object& theta, const py::object& seeds) {
  const RowMatX<double> parameters = theta_in(set, theta);
  const std::vector<std::uint64_t> noise = seeds_in(seeds);
  const PrompSpec& spec = set.rollouts->promp().spec();
  const long T = 1 + std::lround((spec.duration + spec.hold) / set.period);
  const long channels = static_cast<long>(set.channels.size());
  RolloutResult out;
  std::vector<long> index, rows;
  RowMatX<double> values;  // (channels·N × T)
  {
    const py::gil_scoped_release release;
    set.store->rollouts.clear();
    out = set.rollouts->run(parameters, noise);
    for (long i = 0; i < out.rewards.size(); ++i)
      if (out.rewards[i] >= 0.0) index.push_back(i);
    const long N = static_cast<long>(index.size());
    values.resize(channels * N, T);
    for (long k = 0; k < N; ++k) {
      const long place = std::lround(out.rewards[index[static_cast<std::size_t>(k)]]);
      const RowMatX<double>& seen = set.store->rollouts[static_cast<std::size_t>(place)];
      rows.push_back(seen.cols());
      for (long c = 0; c < channels; ++c) {
        values.row(c * N + k).head(seen.cols()) = seen.row(c);
        values.row(c * N + k).tail(T - seen.cols()).setConstant(seen(c, seen.cols() - 1));
      }
    }
    set.store->rollouts.clear();
  }
  const auto N = static_cast<py::ssize_t>(index.size());
  return py::make_tuple(array_out(out.rewards), solved_out(out.solved), out.failures,
                        py::array_t<long>(N, index.data()), py::array_t<long>(N, rows.data()),
                        array_out(std::move(values), {channels, N, T}));
}

void bind_ball_in_cup(py::module_& m) {
  const BallInCupOptions o;
  py::class_<BallInCupTask> ball(
      m, "BallInCupTask",
      "The reward of ball in a cup, and when an episode is over (docs/policy.md).");
  ball.def(py::init([](double epsilon, double lambda_q, double lambda_qd, double lambda_slack,
                       double string) {
             return BallInCupTask({epsilon, lambda_q, lambda_qd, lambda_slack, string});
           }),
           py::kw_only(), "epsilon"_a = o.epsilon, "lambda_q"_a = o.lambda_q,
           "lambda_qd"_a = o.lambda_qd, "lambda_slack"_a = o.lambda_slack, "string"_a = o.string,
           "``epsilon`` of the dipole [m²]; ``lambda_q`` [1/rad²] and ``lambda_qd`` [s²/rad²] of "
           "the joints;\n``lambda_slack`` of the string's slack, 0 in the paper; ``string``, its "
           "length [m].");
  ball.attr("__module__") = "diffnea";
}

void bind_rollout_set(py::module_& m) {
  py::class_<RolloutSet> c(m, "_Rollouts");
  c.def(py::init([](const py::object& simulator, const Promp& promp, const py::object& task,
                    const py::object& ended, bool whole, const py::object& start,
                    const py::object& lower, const py::object& upper, const py::object& velocity,
                    int threads) {
          MotionLimits limits{vector_in("Rollouts: lower", lower),
                              vector_in("Rollouts: upper", upper),
                              vector_in("Rollouts: velocity", velocity)};
          return make_rollouts(*simulator_of(simulator), promp, task, ended, whole,
                               vector_in("Rollouts: start", start), std::move(limits), threads);
        }),
        "simulator"_a, "promp"_a, "task"_a, "ended"_a, "whole"_a, "start"_a, "lower"_a, "upper"_a,
        "velocity"_a, "threads"_a)
      .def("run", &run, "theta"_a, "seeds"_a)
      .def("record", &record, "theta"_a, "seeds"_a)
      .def(
          "trace",
          [](RolloutSet& set, const py::object& theta, std::uint64_t seed) {
            const VecX<double> parameters = vector_in("Rollouts.trace: theta", theta);
            RolloutTrace out;
            {
              const py::gil_scoped_release release;
              out = set.rollouts->trace(parameters, seed);
            }
            if (set.store) set.store->rollouts.clear();
            return trace_out(out);
          },
          "theta"_a, "seed"_a)
      .def_property_readonly("promp", [](const RolloutSet& s) { return s.rollouts->promp(); })
      .def_property_readonly("count", [](const RolloutSet& s) { return s.rollouts->count(); })
      .def_readonly("channels", &RolloutSet::channels)
      .def_readonly("period", &RolloutSet::period);
}

}  // namespace

RolloutSet make_rollouts(const Simulator& simulator, const Promp& promp, const py::object& task,
                         const py::object& ended, bool whole, VecX<double> start,
                         MotionLimits limits, int threads) {
  RolloutSet out;
  out.channels = simulator.channels();
  out.period = simulator.period();
  std::unique_ptr<Task> judge;
  if (!task.is_none()) judge = task_of(task);
  if (whole) {
    out.store = std::make_shared<RolloutStore>();
    judge = std::make_unique<RecordingTask>(std::move(judge),
                                            ended.is_none() ? Held() : hold(ended), out.store);
  }
  if (!judge) throw Error("Rollouts: got neither a task nor a reward; give one of them");
  out.rollouts = std::make_unique<Rollouts>(simulator, *judge, promp, std::move(start),
                                            std::move(limits), threads);
  return out;
}

py::tuple trace_out(const RolloutTrace& trace) {
  return py::make_tuple(array_out(trace.time), py::tuple(py::cast(trace.channels)),
                        array_out(trace.values), array_out(trace.q_desired), trace.reward,
                        trace.solved, trace.failure);
}

void bind_rollouts(py::module_& m) {
  bind_simulator(m);
  bind_ball_in_cup(m);
  bind_rollout_set(m);
}

}  // namespace diffnea::python
