#pragma once
/// One binding unit per flow; module.cpp calls them in this order.

#include <pybind11/pybind11.h>

namespace diffnea::python {

void bind_model(pybind11::module_& m);
void bind_dynamics(pybind11::module_& m);
void bind_constraints(pybind11::module_& m);
void bind_loops(pybind11::module_& m);
void bind_recording(pybind11::module_& m);
void bind_recording_files(pybind11::module_& m);
void bind_trajectory(pybind11::module_& m);
void bind_audit(pybind11::module_& m);
void bind_ball(pybind11::module_& m);
void bind_ball_network(pybind11::module_& m);
void bind_identify(pybind11::module_& m);
void bind_constrained_fit(pybind11::module_& m);
void bind_diagnose(pybind11::module_& m);
void bind_sim(pybind11::module_& m);
void bind_policy(pybind11::module_& m);
void bind_rollouts(pybind11::module_& m);
void bind_task(pybind11::module_& m);
void bind_learned_policy(pybind11::module_& m);
void bind_transfer(pybind11::module_& m);
void bind_robot_data(pybind11::module_& m);

/// diffnea.<module>.<function>, for what is written in Python: data frames, plots, HTML.
inline pybind11::object python_function(const char* module, const char* function) {
  return pybind11::module_::import(module).attr(function);
}

/// `to_frame` of a result; diffnea._tables knows its columns.
template <class Class>
void def_to_frame(Class& c, const char* doc) {
  c.def(
      "to_frame",
      [](const pybind11::object& self) {
        return python_function("diffnea._tables", "frame_of")(self);
      },
      doc);
}

/// A JSON text as dict.
inline pybind11::object parse_json(const std::string& text) {
  return python_function("json", "loads")(text);
}

}  // namespace diffnea::python
