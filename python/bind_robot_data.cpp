/// The data of the paper's experiment, and what is identified from it.

#include <pybind11/stl.h>

#include <diffnea/experiment/robot_data.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/version.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "supervisor.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// Motions of the arm and, about the posture `home`, of the ball.
py::tuple robot_motions(const Model& model, const py::object& home, double arm_seconds,
                        double ball_seconds, std::uint64_t seed) {
  const VecX<double> posture = vector_in("robot_motions: home", home);
  const RobotData data{.arm_seconds = arm_seconds, .ball_seconds = ball_seconds};
  Supervisor supervisor(py::none{});
  const auto design = [&](DesignOptions options) {
    options.progress = [&](const FitProgress& p) { return supervisor(p); };
    return supervisor.run([&] { return design_excitation(model, options); });
  };
  Excitation arm = design(arm_excitation(data, seed + 1));
  Excitation ball = design(ball_excitation(model, posture, data, seed + 2));
  return py::make_tuple(std::move(arm), std::move(ball));
}

/// Fit of the arm, fit of the ball on that arm, and both in one model.
py::tuple identify_robot_python(const Model& nominal, const Recording& arm, const Recording& ball,
                                const py::object& progress) {
  Supervisor supervisor(progress);
  IdentifiedRobot robot = supervisor.run([&] {
    return identify_robot(nominal, arm, ball, [&](const FitProgress& p) { return supervisor(p); });
  });
  Reproduce made;
  made.version = version();
  made.command = {"diffnea.identify_robot"};
  return py::make_tuple(FitRun{.fit = std::move(robot.arm), .reproduce = made},
                        FitRun{.fit = std::move(robot.ball), .reproduce = made},
                        std::move(robot.model));
}

}  // namespace

void bind_robot_data(py::module_& m) {
  m.def("_robot_motions", &robot_motions, "model"_a, "home"_a, "arm_seconds"_a, "ball_seconds"_a,
        "seed"_a);
  m.def("_identify_robot", &identify_robot_python, "nominal"_a, "arm"_a, "ball"_a, "progress"_a);
}

}  // namespace diffnea::python
