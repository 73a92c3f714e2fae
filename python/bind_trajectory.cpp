/// A desired motion: from arrays, as arrays, its file.

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/recording/trajectory.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

Trajectory make_trajectory(const py::object& time, const py::object& q, const py::object& qd,
                           const py::object& qdd, std::vector<std::string> joint_names) {
  Trajectory t;
  t.time = vector_in("Trajectory: time", time);
  require_increasing("Trajectory", t.time);
  t.q = matrix_in("Trajectory: q", q, t.time.size(), joint_names.size() == 1 ? 1 : -1);
  require_names("Trajectory", joint_names, t.q.cols());
  t.joint_names = std::move(joint_names);
  t.qd = matrix_in("Trajectory: qd", qd, t.time.size(), t.q.cols());
  t.qdd = matrix_in("Trajectory: qdd", qdd, t.time.size(), t.q.cols());
  for (const RowMatX<double>* x : {&t.q, &t.qd, &t.qdd})
    if (!x->allFinite()) throw DataError("Trajectory: a value is not finite");
  return t;
}

}  // namespace

void bind_trajectory(py::module_& m) {
  py::class_<Trajectory> t(m, "Trajectory", "Desired motion, N rows and n joints. Never changes.");
  t.def(py::init(&make_trajectory), py::kw_only(), "time"_a, "q"_a, "qd"_a, "qdd"_a,
        "joint_names"_a,
        "``time``: (N,) [s]; ``q``, ``qd``, ``qdd``: (N, n) [rad, rad/s, rad/s²] or [m, …].")
      .def_readonly("joint_names", &Trajectory::joint_names,
                    "Names of the joints, in the order of the columns.")
      .def_property_readonly(
          "time", [](const Trajectory& x) { return array_out(x.time); }, "(N,) [s]")
      .def_property_readonly(
          "q", [](const Trajectory& x) { return array_out(x.q); }, "(N, n) [rad] or [m]")
      .def_property_readonly(
          "qd", [](const Trajectory& x) { return array_out(x.qd); }, "(N, n) [rad/s] or [m/s]")
      .def_property_readonly(
          "qdd", [](const Trajectory& x) { return array_out(x.qdd); }, "(N, n) [rad/s²] or [m/s²]")
      .def("save", &write_trajectory, "path"_a, py::call_guard<py::gil_scoped_release>(),
           "Write a trajectory file (.csv): time, qcmd_*, qdcmd_*, qddcmd_*.")
      .def(
          "to_frame",
          [](const Trajectory& x) {
            return python_function("diffnea._frames", "trajectory_frame")(x);
          },
          "A pandas data frame with the columns of a trajectory file.")
      .def("__len__", &Trajectory::rows)
      .def("__repr__", [](const Trajectory& x) {
        const double seconds = x.rows() > 0 ? x.time[x.rows() - 1] - x.time[0] : 0.0;
        return "Trajectory(" + std::to_string(x.rows()) + " rows, " +
               std::string(py::str("{:.4g}").format(seconds)) + " s, " +
               std::to_string(x.num_joints()) + " joints)";
      });
  t.def(py::pickle(
      [](const Trajectory& x) {
        return py::make_tuple(x.source, x.joint_names, array_out(x.time), array_out(x.q),
                              array_out(x.qd), array_out(x.qdd));
      },
      [](const py::tuple& s) {
        return Trajectory{s[0].cast<std::string>(),     s[1].cast<std::vector<std::string>>(),
                          s[2].cast<VecX<double>>(),    s[3].cast<RowMatX<double>>(),
                          s[4].cast<RowMatX<double>>(), s[5].cast<RowMatX<double>>()};
      }));
  t.attr("__module__") = "diffnea";
  m.def("read_trajectory", &read_trajectory, "path"_a, py::call_guard<py::gil_scoped_release>(),
        "Read a trajectory file (.csv): time, qcmd_*, optionally qdcmd_*, qddcmd_*.");
}

}  // namespace diffnea::python
