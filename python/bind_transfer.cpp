/// Learned policies in a world that is not the model.

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/experiment/ball_in_cup.hpp>
#include <diffnea/runs/policy_result.hpp>
#include <diffnea/worlds/world.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "rollout_set.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// A world that policies are executed in.
struct TransferWorld {
  std::unique_ptr<Simulator> quiet, noisy;
  MotionLimits limits;
  CupSpec cup;
  WorldSpec spec;
  Model controller;
  std::uint64_t seed = 0;
};

TransferWorld make_world(const std::string& name, const Model& controller,
                         const LearnedPolicy& policy, std::optional<double> nominal_string,
                         std::uint64_t seed, double position_noise, double torque_noise,
                         double posture_noise) {
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

Recording record_python(const TransferWorld& world, const LearnedPolicy& policy) {
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
py::tuple execute_python(const TransferWorld& world, const LearnedPolicy& policy, bool noisy,
                         std::uint64_t seed) {
  Execution out;
  {
    const py::gil_scoped_release release;
    out = execute(policy, noisy ? *world.noisy : *world.quiet, world.limits, world.cup, seed);
  }
  return py::make_tuple(out.seed, outcome_word(out), out.verdict.text, out.reward, out.reward_wide,
                        out.failure, trace_out(out.trace));
}

}  // namespace

void bind_transfer(py::module_& m) {
  py::class_<TransferWorld> c(m, "_World");
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
  m.attr("_BALL_IN_CUP_WORLD") = kBallInCupWorld;
  m.def(
      "_world_differences", [](const std::string& name) { return differences(parse_world(name)); },
      "name"_a);
  m.def("_world_file", [](const std::string& name) { return parse_world(name).mjcf; }, "name"_a);
}

}  // namespace diffnea::python
