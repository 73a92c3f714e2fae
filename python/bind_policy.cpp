/// Movement primitives and policy search.

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/ereps.hpp>
#include <diffnea/policy/promp.hpp>

#include "bindings.hpp"
#include "ereps_history.hpp"
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
            static_assert(diffnea::detail::member_count<PrompSpec>() == 8,
                          "name the new field here");
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
  value_type<ErepsOptions>(m).def(
      py::init([](int samples, double epsilon, double kappa, int iterations, double stop_std,
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

}  // namespace

void bind_policy(py::module_& m) {
  bind_gaussian(m);
  bind_promp(m);
  bind_ereps(m);
}

}  // namespace diffnea::python
