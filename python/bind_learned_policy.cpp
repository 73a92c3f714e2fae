/// A learned policy: its motion, its file, its state for copies.

#include <charconv>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/experiment/ball_in_cup.hpp>
#include <diffnea/runs/policy_file.hpp>

#include "bindings.hpp"
#include "ereps_history.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

py::tuple policy_state(const LearnedPolicy& p) {
  static_assert(diffnea::detail::member_count<LearnedPolicy>() == 15, "name the new field here");
  return py::make_tuple(p.seed, Promp(p.promp), p.policy, p.joints, array_out(p.start),
                        dict_of(p.controller), dict_of(p.reward), history_out(p.curve), p.stopped,
                        p.expected, p.solved, p.rollouts, p.seconds,
                        py::make_tuple(p.in_draws.count, p.in_draws.caught, p.in_draws.reward),
                        p.ball_network.file, p.ball_network.sha256);
}

LearnedPolicy policy_from(const py::tuple& s) {
  const auto [count, caught, reward] = py::cast<std::tuple<int, int, double>>(s[13]);
  return {.seed = py::cast<std::uint64_t>(s[0]),
          .promp = py::cast<const Promp&>(s[1]).spec(),
          .policy = py::cast<Gaussian>(s[2]),
          .joints = py::cast<std::vector<std::string>>(s[3]),
          .start = vector_in("Policy", s[4]),
          .controller = from_fields<ControllerOptions>(s[5]),
          .reward = from_fields<BallInCupOptions>(s[6]),
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
  char reward[32] = {};  // a point in every locale
  std::to_chars(reward, reward + sizeof reward - 1, p.expected, std::chars_format::fixed, 3);
  const std::string text = std::to_string(p.policy.size()) + " weights, " +
                           std::to_string(p.curve.size()) + " iterations, " +
                           std::to_string(p.rollouts) + " rollouts; reward of the mean " + reward;
  const std::string draws = p.in_draws.count == 0
                                ? ""
                                : ", in " + std::to_string(p.in_draws.caught) + " of " +
                                      std::to_string(p.in_draws.count) + " draws";
  return "Policy(seed " + std::to_string(p.seed) + ": " + (p.solved ? "solved" : "not solved") +
         " in the model" + draws + "; " + text + (p.stopped.empty() ? "; interrupted)" : ")");
}

}  // namespace

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
          "controller", [](const P& p) { return dict_of(p.controller); },
          "Law, rate and gains as they were simulated.")
      .def_property_readonly(
          "reward", [](const P& p) { return dict_of(p.reward); }, "Options of the reward.")
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

}  // namespace diffnea::python
