/// Movement primitives, policy search, and rollouts in any world.

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>
#include <diffnea/io/world.hpp>
#include <diffnea/policy/ball_in_cup.hpp>
#include <diffnea/policy/ereps.hpp>
#include <diffnea/sim/model_simulator.hpp>

#include "bindings.hpp"
#include "control_law.hpp"
#include "ereps_history.hpp"
#include "rollout_set.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

Gaussian make_gaussian(const py::object& mean, const py::object& covariance) {
  Gaussian out;
  out.mean = vector_in("Gaussian: mean", mean);
  out.covariance = matrix_in("Gaussian: covariance", covariance, out.mean.size(), out.mean.size());
  constexpr double kRounding = 1e-9;  // of a product with its transpose
  if (!out.covariance.isApprox(out.covariance.transpose(), kRounding))
    throw Error("Gaussian: covariance: it is not symmetric");
  out.entropy();  // throws
  return out;
}

py::tuple gaussian_state(const Gaussian& g) {
  return py::make_tuple(array_out(g.mean), array_out(RowMatX<double>(g.covariance)));
}

void bind_gaussian(py::module_& m) {
  py::class_<Gaussian> c(m, "Gaussian", "A Gaussian over the parameters of a policy.");
  c.def(py::init(&make_gaussian), "mean"_a, "covariance"_a,
        "``mean`` (d,), ``covariance`` (d, d), positive definite.")
      .def_property_readonly(
          "mean", [](const Gaussian& g) { return array_out(g.mean); }, "(d,)")
      .def_property_readonly(
          "covariance", [](const Gaussian& g) { return array_out(RowMatX<double>(g.covariance)); },
          "(d, d)")
      .def_property_readonly(
          "std", [](const Gaussian& g) { return array_out(g.std()); }, "(d,) of every parameter.")
      .def("entropy", &Gaussian::entropy, "[nat]")
      .def(
          "sample",
          [](const Gaussian& g, int count, std::uint64_t seed) {
            if (count < 0) throw Error("Gaussian.sample: count: got a negative number");
            Rng rng(seed);
            return array_out(g.sample(count, rng));
          },
          "count"_a, py::kw_only(), "seed"_a = 0, "(count, d), the same for the same seed.")
      .def(
          "kl", [](const Gaussian& a, const Gaussian& b) { return kl_divergence(a, b); }, "other"_a,
          "KL(self ‖ other) [nat].")
      .def(
          "conditioned",
          [](const Gaussian& g, const py::object& a, const py::object& y, const py::object& r) {
            const VecX<double> seen = vector_in("Gaussian.conditioned: y", y);
            return conditioned(g, matrix_in("Gaussian.conditioned: A", a, seen.size(), g.size()),
                               seen,
                               matrix_in("Gaussian.conditioned: R", r, seen.size(), seen.size()));
          },
          "A"_a, "y"_a, "R"_a,
          "Given that A θ = y up to noise of covariance R; ``A`` (m, d), ``y`` (m,), ``R`` (m, m).")
      .def(
          "__repr__",
          [](const Gaussian& g) { return "Gaussian(" + std::to_string(g.size()) + " parameters)"; })
      .def(py::pickle(&gaussian_state,
                      [](const py::tuple& state) { return make_gaussian(state[0], state[1]); }));
  c.attr("__module__") = "diffnea";
}

Gaussian via_point(const Promp& promp, const Gaussian& prior, double time, const py::object& q,
                   double std) {
  const long joints = static_cast<long>(promp.spec().joints.size());
  const VecX<double> target = vector_in("Promp.via: q", q, joints);
  VecX<double> phi, phi_d;
  promp.features(time, phi, phi_d);
  MatX<double> A = MatX<double>::Zero(joints, promp.size());
  for (long j = 0; j < joints; ++j) A.row(j).segment(j * phi.size(), phi.size()) = phi.transpose();
  return conditioned(prior, A, target, std * std * MatX<double>::Identity(joints, joints));
}

void bind_promp(py::module_& m) {
  const PrompSpec o;
  py::class_<Promp> c(
      m, "Promp",
      "A movement primitive: joint motions that are linear in weights, q(t) = q_0 + Σ w φ(t/T).\n\n"
      "Motions start exactly at q_0 and at rest, and end at rest; after T the posture of T is "
      "held.");
  c.def(py::init([](const std::vector<std::string>& joints, int bases, int held_first,
                    int held_last, double width, double duration, double hold, bool returns) {
          return Promp({.joints = joints,
                        .bases = bases,
                        .held_first = held_first,
                        .held_last = held_last,
                        .width = width,
                        .duration = duration,
                        .hold = hold,
                        .returns = returns});
        }),
        "joints"_a, py::kw_only(), "bases"_a = o.bases, "held_first"_a = o.held_first,
        "held_last"_a = o.held_last, "width"_a = o.width, "duration"_a = o.duration,
        "hold"_a = o.hold, "returns"_a = o.returns,
        "``joints`` that move; ``bases`` a joint, of which the first and last ``held_…`` have no "
        "weight;\n"
        "``width`` of a basis in spacings; ``duration`` T and ``hold`` after it [s]; ``returns`` "
        "to q_0 at T.");
  const auto of = [&c](const char* name, auto member, const char* doc) {
    c.def_property_readonly(name, [member](const Promp& p) { return p.spec().*member; }, doc);
  };
  of("joints", &PrompSpec::joints, "That move.");
  of("bases", &PrompSpec::bases, "A joint.");
  of("held_first", &PrompSpec::held_first, "Bases at the beginning without a weight.");
  of("held_last", &PrompSpec::held_last, "Bases at the end without a weight.");
  of("width", &PrompSpec::width, "Of a basis, in spacings of the centres.");
  of("duration", &PrompSpec::duration, "T [s]");
  of("hold", &PrompSpec::hold, "After T [s].");
  of("returns", &PrompSpec::returns, "To q_0 at T.");
  c.def_property_readonly("size", &Promp::size, "Number d of weights, joint by joint.")
      .def(
          "features",
          [](const Promp& p, const py::object& times) {
            const VecX<double> t = vector_in("Promp.features: times", times);
            RowMatX<double> phi(t.size(), p.parameters_per_joint()), phi_d = phi;
            VecX<double> row, row_d;
            for (long k = 0; k < t.size(); ++k) {
              p.features(t[k], row, row_d);
              phi.row(k) = row.transpose();
              phi_d.row(k) = row_d.transpose();
            }
            return py::make_tuple(array_out(phi), array_out(phi_d));
          },
          "times"_a, "φ and dφ/dt [1/s] at ``times`` (T,) [s]: (T, weights of a joint) each.")
      .def(
          "motion",
          [](const Promp& p, const py::object& theta, const py::object& times) {
            RowMatX<double> q, qd;
            p.motion(vector_in("Promp.motion: theta", theta),
                     vector_in("Promp.motion: times", times), q, qd);
            return py::make_tuple(array_out(q), array_out(qd));
          },
          "theta"_a, "times"_a,
          "Positions relative to q_0 [rad] and velocities [rad/s] at ``times`` (T,) [s]: (T, "
          "joints) each.")
      .def("via", &via_point, "policy"_a, py::kw_only(), "time"_a, "q"_a, "std"_a = 1e-3,
           "``policy`` given that the joints are at ``q`` (joints,) relative to q_0 [rad] at "
           "``time`` [s],\nup to ``std`` [rad].")
      .def("__repr__",
           [](const Promp& p) {
             return "Promp(" + std::string(py::repr(py::cast(p.spec().joints))) + ", " +
                    std::to_string(p.size()) + " weights, " +
                    std::string(py::repr(py::cast(p.spec().duration))) + " s)";
           })
      .def(py::pickle(
          [](const Promp& p) {
            const PrompSpec& s = p.spec();
            static_assert(detail::field_count<PrompSpec>() == 8, "name the new field here");
            return py::make_tuple(s.joints, s.bases, s.held_first, s.held_last, s.width, s.duration,
                                  s.hold, s.returns);
          },
          [](const py::tuple& s) {
            return Promp({py::cast<std::vector<std::string>>(s[0]), py::cast<int>(s[1]),
                          py::cast<int>(s[2]), py::cast<int>(s[3]), py::cast<double>(s[4]),
                          py::cast<double>(s[5]), py::cast<double>(s[6]), py::cast<bool>(s[7])});
          }));
  c.attr("__module__") = "diffnea";
}

void tell(Ereps& search, const py::object& rewards, const py::object& solved) {
  const int samples = search.options().samples;
  const VecX<double> told = vector_in("Ereps.tell: rewards", rewards, samples);
  double share = 0.0;
  if (!solved.is_none())
    share = vector_in("Ereps.tell: solved", solved, samples).cwiseMin(1.0).mean();
  {
    const py::gil_scoped_release release;
    search.tell(told);
  }
  search.history().back().solved_share = share;
}

void bind_ereps(py::module_& m) {
  const ErepsOptions o;
  value_type<ErepsOptions>(
      m, "ErepsOptions", "How a search goes, and when it stops.",
      field("samples", &ErepsOptions::samples, "Of an iteration."),
      field("epsilon", &ErepsOptions::epsilon, "KL bound of the reweighted samples [nat]."),
      field("kappa", &ErepsOptions::kappa, "KL(old ‖ new) bound of the Gaussian's update [nat]."),
      field("iterations", &ErepsOptions::iterations, "At most."),
      field("stop_std", &ErepsOptions::stop_std,
            "Done when every parameter's standard deviation is below."),
      field("least_std", &ErepsOptions::least_std, "Every direction's stays above."))
      .def(py::init([](int samples, double epsilon, double kappa, int iterations, double stop_std,
                       double least_std) {
             return ErepsOptions{samples, epsilon, kappa, iterations, stop_std, least_std};
           }),
           py::kw_only(), "samples"_a = o.samples, "epsilon"_a = o.epsilon, "kappa"_a = o.kappa,
           "iterations"_a = o.iterations, "stop_std"_a = o.stop_std, "least_std"_a = o.least_std);
  py::class_<Ereps> c(
      m, "Ereps",
      "Episodic relative entropy policy search: ask for samples, tell their rewards.\n\n"
      "    while not search.done:\n"
      "        search.tell(rewards_of(search.ask()))");
  c.def(py::init([](const Gaussian& start, std::uint64_t seed, int samples, double epsilon,
                    double kappa, int iterations, double stop_std, double least_std) {
          return Ereps(start, {samples, epsilon, kappa, iterations, stop_std, least_std}, seed);
        }),
        "start"_a, py::kw_only(), "seed"_a = 0, "samples"_a = o.samples, "epsilon"_a = o.epsilon,
        "kappa"_a = o.kappa, "iterations"_a = o.iterations, "stop_std"_a = o.stop_std,
        "least_std"_a = o.least_std,
        "From the Gaussian ``start``; the others are fields of :class:`ErepsOptions`.")
      .def(
          "ask", [](Ereps& search) { return array_out(search.ask()); },
          "Samples of this iteration, (N, d): the same however often one asks.")
      .def("tell", &tell, "rewards"_a, "solved"_a = py::none(),
           "``rewards`` (N,), finite or −inf (never again); ``solved`` (N,) booleans, for the "
           "history alone.\n"
           "A NaN is a :class:`DataError` naming iteration, sample and parameters; the search is "
           "then as it was.")
      .def_property_readonly("done", &Ereps::done, "It has stopped.")
      .def_property_readonly("stop_reason", &Ereps::stop_reason, "Empty while it goes on.")
      .def_property_readonly(
          "policy", [](const Ereps& s) { return s.policy(); }, "The :class:`Gaussian` so far.")
      .def_property_readonly(
          "best", [](const Ereps& s) { return array_out(s.best()); },
          "(d,) best sample so far; empty before the first.")
      .def_property_readonly(
          "history", [](const Ereps& s) { return history_out(s.history()); },
          "Arrays by name, one entry an iteration.")
      .def_property_readonly(
          "options", [](const Ereps& s) { return s.options(); }, "The :class:`ErepsOptions`.")
      .def_property_readonly("seed", &Ereps::seed, "Of the samples.")
      .def_property_readonly("iteration", &Ereps::iteration, "Iterations done.")
      .def("__repr__",
           [](const Ereps& s) {
             return "Ereps(" + std::to_string(s.policy().size()) + " parameters, iteration " +
                    std::to_string(s.iteration()) +
                    (s.done() ? ", done: " + s.stop_reason() : std::string()) + ")";
           })
      .def(py::pickle(
          [](const Ereps& s) {
            return py::make_tuple(s.policy(), s.options(), s.seed(), array_out(s.best()),
                                  history_out(s.history()));
          },
          [](const py::tuple& s) {
            const Gaussian policy = py::cast<Gaussian>(s[0]);
            Ereps out(policy, py::cast<ErepsOptions>(s[1]), py::cast<std::uint64_t>(s[2]));
            out.restore(policy, vector_in("Ereps", s[3]), history_in(s[4]));
            return out;
          }));
  c.attr("__module__") = "diffnea";
}

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
        options.controller.law = choice("model_simulator: law", law, kLaws);
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

/// Nothing ends, and nothing is worth anything.
class Watch : public Task {
 public:
  void begin(const Simulator&, int count) override { count_ = count; }
  void look(double, const Lanes&, std::vector<char>&) override {}
  VecX<double> rewards() const override { return VecX<double>::Zero(count_); }
  std::unique_ptr<Task> clone() const override { return std::make_unique<Watch>(*this); }

 private:
  int count_ = 0;
};

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

void bind_rollouts(py::module_& m) {
  const BallInCupOptions o;
  py::class_<BallInCupTask> ball(
      m, "BallInCupTask",
      "The reward of ball in a cup, and when an episode is over (docs/policy.md).");
  ball.def(py::init([](double epsilon, double lambda_q, double lambda_qd, double string) {
             return BallInCupTask({epsilon, lambda_q, lambda_qd, string});
           }),
           py::kw_only(), "epsilon"_a = o.epsilon, "lambda_q"_a = o.lambda_q,
           "lambda_qd"_a = o.lambda_qd, "string"_a = o.string,
           "``epsilon`` of the dipole [m²]; ``lambda_q`` [1/rad²] and ``lambda_qd`` [s²/rad²] of "
           "the joints;\n``string``, its length [m].");
  ball.attr("__module__") = "diffnea";

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
      .def_property_readonly("start",
                             [](const RolloutSet& s) { return array_out(s.rollouts->start()); })
      .def_property_readonly("count", [](const RolloutSet& s) { return s.rollouts->count(); })
      .def_readonly("joints", &RolloutSet::joints)
      .def_readonly("channels", &RolloutSet::channels)
      .def_readonly("period", &RolloutSet::period);
}

}  // namespace

RolloutSet make_rollouts(const Simulator& simulator, const Promp& promp, const py::object& task,
                         const py::object& ended, bool whole, VecX<double> start,
                         MotionLimits limits, int threads) {
  RolloutSet out;
  out.joints = simulator.joints();
  out.channels = simulator.channels();
  out.period = simulator.period();
  std::unique_ptr<Task> judge;
  if (!task.is_none()) judge = task_of(task);
  if (whole) {
    out.store = std::make_shared<RolloutStore>();
    judge = std::make_unique<RecordingTask>(std::move(judge),
                                            ended.is_none() ? Held() : hold(ended), out.store);
  }
  if (!judge) judge = std::make_unique<Watch>();
  out.rollouts = std::make_unique<Rollouts>(simulator, *judge, promp, std::move(start),
                                            std::move(limits), threads);
  return out;
}

py::tuple trace_out(const RolloutTrace& trace) {
  return py::make_tuple(array_out(trace.time), py::tuple(py::cast(trace.channels)),
                        array_out(trace.values), array_out(trace.q_desired), trace.reward,
                        trace.solved, trace.failure);
}

void bind_policy(py::module_& m) {
  bind_gaussian(m);
  bind_promp(m);
  bind_ereps(m);
  bind_simulator(m);
  bind_rollouts(m);
}

}  // namespace diffnea::python
