/// The data of the paper's experiment, and what is identified from it.

#include <pybind11/stl.h>

#include <diffnea/experiment/robot_data.hpp>
#include <diffnea/io/result.hpp>
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
  std::vector<Excitation> found;
  {
    const py::gil_scoped_release release;
    for (DesignOptions design :
         {arm_excitation(data, seed + 1), ball_excitation(model, posture, data, seed + 2)}) {
      design.progress = [&](const FitProgress& p) { return supervisor(p); };
      found.push_back(design_excitation(model, design));
    }
  }
  supervisor.rethrow();
  return py::make_tuple(found[0], found[1]);
}

/// Fit of the arm, fit of the ball on that arm, and both in one model.
py::tuple identify_robot_python(const Model& nominal, const Recording& arm, const Recording& ball,
                                const py::object& progress) {
  Supervisor supervisor(progress);
  IdentifiedRobot robot;
  {
    const py::gil_scoped_release release;
    robot = identify_robot(nominal, arm, ball, [&](const FitProgress& p) { return supervisor(p); });
  }
  supervisor.rethrow();
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
