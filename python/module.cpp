#include <string>

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>
#include <diffnea/runs/schemas.hpp>
#include <diffnea/version.hpp>

#include "bindings.hpp"

namespace py = pybind11;

namespace {

template <class E>
py::object bind_error(py::module_& m, const char* name, const py::handle& base, const char* doc) {
  py::object type = py::register_exception<E>(m, name, base);
  type.attr("__module__") = "diffnea";
  type.attr("__doc__") = doc;
  return type;
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.doc() = "Compiled part of diffnea.";
  m.attr("__version__") = std::string(diffnea::version());

  // pybind11 tries the translator that was registered last first: the base class comes first.
  const py::object error = bind_error<diffnea::Error>(
      m, "Error", PyExc_ValueError, "A mistake that the caller can mend; the message says how.");
  bind_error<diffnea::ShapeError>(m, "ShapeError", error, "An array has the wrong shape.");
  bind_error<diffnea::ModelError>(
      m, "ModelError", error,
      "A robot description, or the effects on it, cannot be true or cannot be read.");
  bind_error<diffnea::DataError>(
      m, "DataError", error,
      "A recording cannot be true, cannot be read, or does not suit the model.");
  bind_error<diffnea::FileError>(m, "FileError", error,
                                 "A file or folder cannot be read or written.");

  m.def("_schema_names", &diffnea::schema_names);
  m.def("_json_schema", [](const std::string& name) {
    return diffnea::python::parse_json(diffnea::json_schema(name)).cast<py::dict>();
  });

  diffnea::python::bind_model(m);
  diffnea::python::bind_dynamics(m);
  diffnea::python::bind_constraints(m);
  diffnea::python::bind_loops(m);
  diffnea::python::bind_recording(m);
  diffnea::python::bind_recording_files(m);
  diffnea::python::bind_trajectory(m);
  diffnea::python::bind_audit(m);
  diffnea::python::bind_ball(m);
  diffnea::python::bind_ball_network(m);
  diffnea::python::bind_identify(m);
  diffnea::python::bind_constrained_fit(m);
  diffnea::python::bind_diagnose(m);
  diffnea::python::bind_sim(m);
  diffnea::python::bind_policy(m);
  diffnea::python::bind_rollouts(m);
  diffnea::python::bind_task(m);
  diffnea::python::bind_learned_policy(m);
  diffnea::python::bind_transfer(m);
  diffnea::python::bind_robot_data(m);
}
