/// A recording: from arrays, as arrays, and its state for copies.

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/recording.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "recording_info.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

void require_finite_or_gap(const std::string& what, const RowMatX<double>& x) {
  for (long k = 0; k < x.rows(); ++k)
    for (long j = 0; j < x.cols(); ++j)
      if (std::isinf(x(k, j)))
        throw DataError(
            what + "[" + std::to_string(k) + ", " + std::to_string(j) +
            "] is infinite; NaN marks a gap, rows that cannot be true must be left out");
}

RowMatX<double> series(const char* name, const py::object& x, long rows, long columns) {
  const std::string what = std::string("Recording: ") + name;
  RowMatX<double> out = matrix_in(what, x, rows, columns);
  require_finite_or_gap(what, out);
  return out;
}

RowMatX<double> optional_series(const char* name, const py::object& x, long rows, long columns) {
  return x.is_none() ? RowMatX<double>() : series(name, x, rows, columns);
}

/// Which joints have a torque: a column of gaps is a prescribed joint's, a declared one's is zero.
void classify_torques(Recording& r) {
  const long n = r.num_joints();
  for (const std::string& name : r.info.passive)
    if (std::ranges::find(r.joint_names, name) == r.joint_names.end())
      throw DataError("Recording: passive names '" + name + "', which is not in joint_names");
  r.has_tau.assign(static_cast<std::size_t>(n), true);
  for (long j = 0; j < n; ++j) {
    const std::string& name = r.joint_names[static_cast<std::size_t>(j)];
    const bool passive = std::ranges::find(r.info.passive, name) != r.info.passive.end();
    const bool zero = (r.tau.col(j).array() == 0.0).all();
    const bool unknown = r.tau.col(j).array().isNaN().all();
    if (passive && !zero && !unknown)
      throw DataError("Recording: joint '" + name + "' is passive, but its torque is not zero");
    if (zero && !passive)
      throw DataError("Recording: the torque of joint '" + name +
                      "' is zero in every row; passive=['" + name +
                      "'] if it is known to be zero, NaN if it is unknown (motion prescribed)");
    if (passive) r.tau.col(j).setZero();
    r.has_tau[static_cast<std::size_t>(j)] = !passive && !unknown;
  }
}

/// The keys of a sidecar's payload.
std::optional<HeldBody> held_body(const std::optional<py::dict>& given) {
  if (!given) return std::nullopt;
  HeldBody body;
  for (const auto& [key, value] : *given) {
    const std::string name = py::cast<std::string>(key);
    if (name == "name")
      body.name = py::cast<std::string>(value);
    else if (name == "where")
      body.where = py::cast<std::string>(value);
    else if (name == "mass")
      body.mass = py::cast<double>(value);
    else if (name == "com")
      body.com = py::cast<std::array<double, 3>>(value);
    else if (name == "about_com")
      body.about_com = py::cast<std::array<double, 6>>(value);
    else
      throw DataError("Recording: payload has no key '" + name +
                      "'; keys: name, where, mass, com, about_com");
  }
  if (body.mass && !(*body.mass >= 0.0))
    throw DataError("Recording: payload: mass is " + std::to_string(*body.mass) +
                    " kg, expected 0 or more");
  if ((body.com && !body.mass) || (body.about_com && !body.com))
    throw DataError(
        "Recording: payload: a center of mass needs the mass, an inertia about it needs both");
  return body;
}

py::object payload_dict(const std::optional<HeldBody>& body) {
  if (!body) return py::none();
  py::dict out;
  if (!body->name.empty()) out["name"] = body->name;
  out["where"] = body->where;
  if (body->mass) out["mass"] = *body->mass;
  if (body->com) out["com"] = *body->com;
  if (body->about_com) out["about_com"] = *body->about_com;
  return out;
}

Recording make_recording(const py::object& time, const py::object& q, const py::object& tau,
                         std::vector<std::string> joint_names, const py::object& qd,
                         const py::object& qdd, const py::object& qcmd, const py::object& qdcmd,
                         const py::object& taucmd, const py::object& ball, const py::object& spin,
                         const py::object& base, const py::object& base_twist,
                         const py::object& base_wrench,
                         const std::map<std::string, py::object>& extra,
                         const std::string& torque_side,
                         const std::optional<std::string>& torque_sampling,
                         std::vector<std::string> passive, std::optional<double> period,
                         const std::map<std::string, double>& torque_constant,
                         const std::optional<py::dict>& payload, std::string source) {
  Recording r;
  r.source = std::move(source);
  r.time = vector_in("Recording: time", time);
  require_increasing("Recording", r.time);
  const long N = r.time.size();
  if (N == 0) throw DataError("Recording: got no rows");
  const bool bare = q.is_none() && joint_names.empty() && !base.is_none();  // a body alone
  r.q = bare ? RowMatX<double>(N, 0) : series("q", q, N, joint_names.size() == 1 ? 1 : -1);
  const long n = r.q.cols();
  if (!bare) require_names("Recording", joint_names, n);
  r.joint_names = std::move(joint_names);
  r.qd = optional_series("qd", qd, N, n);
  r.qdd = optional_series("qdd", qdd, N, n);
  r.qcmd = optional_series("qcmd", qcmd, N, n);
  r.qdcmd = optional_series("qdcmd", qdcmd, N, n);
  r.taucmd = optional_series("taucmd", taucmd, N, n);
  r.ball = optional_series("ball", ball, N, 3);
  r.spin = optional_series("spin", spin, N, 3);
  r.base = optional_series("base", base, N, 7);
  r.base_twist = optional_series("base_twist", base_twist, N, 6);
  r.base_wrench = optional_series("base_wrench", base_wrench, N, 6);
  if (r.base.size() == 0 && (r.base_twist.size() > 0 || r.base_wrench.size() > 0))
    throw DataError("Recording: base_twist and base_wrench need the pose of the base, base=");
  r.tau = tau.is_none() ? RowMatX<double>::Constant(N, n, std::nan("")) : series("tau", tau, N, n);
  for (const auto& [name, values] : extra)
    r.extra.push_back({name, vector_in("Recording: extra['" + name + "']", values, N)});
  r.info = recording_info(torque_side, torque_sampling);
  r.info.passive = std::move(passive);
  r.info.period = period.value_or(0.0);
  r.info.torque_constant.assign(torque_constant.begin(), torque_constant.end());
  r.info.payload = held_body(payload);
  if (!(r.info.period >= 0.0)) throw DataError("Recording: period must not be negative");
  classify_torques(r);
  return r;
}

py::object or_none(const RowMatX<double>& x) {
  if (x.size() == 0) return py::none();
  return array_out(x);
}

std::string recording_repr(const Recording& r) {
  std::string joints;
  for (const std::string& name : r.joint_names) joints += (joints.empty() ? "" : ", ") + name;
  const double seconds = r.rows() > 0 ? r.time[r.rows() - 1] - r.time[0] : 0.0;
  std::string channels = "q";
  for (const auto& [name, values] : {std::pair{"qd", &r.qd},
                                     {"qdd", &r.qdd},
                                     {"qcmd", &r.qcmd},
                                     {"qdcmd", &r.qdcmd},
                                     {"taucmd", &r.taucmd},
                                     {"ball", &r.ball},
                                     {"spin", &r.spin},
                                     {"base", &r.base},
                                     {"base_twist", &r.base_twist},
                                     {"base_wrench", &r.base_wrench}})
    if (values->size() > 0) channels += std::string(", ") + name;
  const long torques = std::ranges::count(r.has_tau, true);
  if (torques > 0) channels += ", tau";
  if (torques > 0 && torques < r.num_joints()) channels += " of " + std::to_string(torques);
  for (const ExtraChannel& e : r.extra) channels += ", " + e.name;
  return "Recording(" + std::to_string(r.rows()) + " rows, " +
         std::string(py::str("{:.4g}").format(seconds)) + " s, " + std::to_string(r.num_joints()) +
         (r.num_joints() == 1 ? " joint [" : " joints [") + joints + "]: " + channels +
         (r.info.torque_side == TorqueSide::kLink ? "; torque of the link side)" : ")");
}

Recording rows_of(const Recording& r, const py::slice& slice) {
  py::ssize_t start = 0, stop = 0, step = 0, count = 0;
  if (!slice.compute(r.rows(), &start, &stop, &step, &count)) throw py::error_already_set();
  if (step != 1) throw ShapeError("Recording[…]: a step other than 1 would change the sampling");
  if (count == 0) throw DataError("Recording[…]: no rows are left");
  Recording out = r;
  const auto cut = [&](RowMatX<double>& x) {
    if (x.size() > 0) x = RowMatX<double>(x.middleRows(start, count));
  };
  out.time = VecX<double>(r.time.segment(start, count));
  for (const auto member : kSeries) cut(out.*member);
  for (ExtraChannel& e : out.extra) e.values = VecX<double>(e.values.segment(start, count));
  return out;
}

}  // namespace

void bind_recording(py::module_& m) {
  py::class_<Recording> c(m, "Recording",
                          "Measured series of one robot, N rows and n joints, in SI units. NaN is "
                          "a gap. Never changes.");
  c.def(
       py::init(&make_recording), py::kw_only(), "time"_a, "q"_a = py::none(), "tau"_a = py::none(),
       "joint_names"_a = std::vector<std::string>{}, "qd"_a = py::none(), "qdd"_a = py::none(),
       "qcmd"_a = py::none(), "qdcmd"_a = py::none(), "taucmd"_a = py::none(),
       "ball"_a = py::none(), "spin"_a = py::none(), "base"_a = py::none(),
       "base_twist"_a = py::none(), "base_wrench"_a = py::none(), "extra"_a = py::dict(),
       "torque_side"_a = "motor", "torque_sampling"_a = py::none(),
       "passive"_a = std::vector<std::string>{}, "period"_a = py::none(),
       "torque_constant"_a = std::map<std::string, double>{}, "payload"_a = py::none(),
       "source"_a = "arrays",
       "``time``: (N,) [s], strictly increasing. ``q``, ``tau``, ``qd``, ``qdd``, ``qcmd``: (N, "
       "n) [rad, N·m, rad/s,\n"
       "rad/s²] or [m, N, …]. ``qdcmd``, ``taucmd``: (N, n) velocity [rad/s] and torque [N·m] that "
       "drives were told beside ``qcmd``. A column of ``tau`` that is NaN throughout belongs to a "
       "joint whose "
       "motion is prescribed;\n"
       "``passive`` names joints whose torque is known to be zero. ``ball``, ``spin``: (N, 3) "
       "[m], [rad/s] in the\n"
       "world. ``base``: (N, 7) x y z [m] and qx qy qz qw of the link that floats, its pose in the "
       "world.\n"
       "``base_twist``: (N, 6) its twist [ω; v] against the world, in its own axes [rad/s, m/s]; "
       "``base_wrench``:\n"
       "(N, 6) the known wrench [τ; f] on it from outside, likewise [N·m, N], None: it flies. "
       "``extra``: further channels (N,) by name. ``torque_side``: ``motor``, or ``link`` "
       "for joint torque\n"
       "sensors. ``torque_sampling``: ``hold`` (row k's torque acts from row k to k+1; default of "
       "the motor side)\n"
       "or ``instant``. ``period``: of a periodic motion [s]. ``torque_constant``: [N·m/A], by "
       "joint, "
       "that ``tau`` was made\n"
       "with. ``payload``: a body that the robot held, as in a sidecar: ``mass`` [kg], ``com`` "
       "[m], "
       "``about_com`` [kg·m²],\n"
       "``where``, ``name``, each left out if it is not known.")
      .def_readonly("source", &Recording::source, "Where it comes from, for messages.")
      .def_readonly("run", &Recording::run, "Number of the run in its file.")
      .def_readonly("joint_names", &Recording::joint_names,
                    "Names of the joints, in the order of the columns.")
      .def_property_readonly("num_joints", &Recording::num_joints, "Number n of joints.")
      .def_property_readonly(
          "time", [](const Recording& r) { return array_out(r.time); }, "(N,) [s]")
      .def_property_readonly(
          "q", [](const Recording& r) { return array_out(r.q); }, "(N, n) [rad] or [m]")
      .def_property_readonly(
          "qd", [](const Recording& r) { return or_none(r.qd); },
          "(N, n) measured velocity, or None.")
      .def_property_readonly(
          "qdd", [](const Recording& r) { return or_none(r.qdd); },
          "(N, n) measured acceleration, or None.")
      .def_property_readonly(
          "qcmd", [](const Recording& r) { return or_none(r.qcmd); },
          "(N, n) desired position, or None.")
      .def_property_readonly(
          "qdcmd", [](const Recording& r) { return or_none(r.qdcmd); },
          "(N, n) desired velocity beside it, or None.")
      .def_property_readonly(
          "taucmd", [](const Recording& r) { return or_none(r.taucmd); },
          "(N, n) torque asked of the drives beside both [N·m] or [N], or None.")
      .def_property_readonly(
          "tau", [](const Recording& r) { return array_out(r.tau); },
          "(N, n) [N·m] or [N]; zero at a passive joint (NaN as ``simulate`` returns it), NaN at a "
          "prescribed one.")
      .def_readonly("has_tau", &Recording::has_tau, "Per joint: its torque was measured.")
      .def_property_readonly(
          "ball", [](const Recording& r) { return or_none(r.ball); }, "(N, 3) [m], world, or None.")
      .def_property_readonly(
          "spin", [](const Recording& r) { return or_none(r.spin); },
          "(N, 3) [rad/s], world, or None.")
      .def_property_readonly(
          "base", [](const Recording& r) { return or_none(r.base); },
          "(N, 7) x y z [m] and qx qy qz qw of the base in the world, or None: it is fixed.")
      .def_property_readonly(
          "base_twist", [](const Recording& r) { return or_none(r.base_twist); },
          "(N, 6) measured [ω; v] of the base against the world, in its axes [rad/s, m/s], or "
          "None.")
      .def_property_readonly(
          "base_wrench", [](const Recording& r) { return or_none(r.base_wrench); },
          "(N, 6) known [τ; f] on the base from outside, in its axes, about its origin [N·m, N], "
          "or None.")
      .def_property_readonly(
          "extra",
          [](const Recording& r) {
            py::dict out;
            for (const ExtraChannel& e : r.extra) out[py::str(e.name)] = array_out(e.values);
            return out;
          },
          "Further channels (N,) by name.")
      .def_property_readonly(
          "torque_side",
          [](const Recording& r) {
            return r.info.torque_side == TorqueSide::kLink ? "link" : "motor";
          },
          "``motor`` or ``link``: where torque was measured.")
      .def_property_readonly(
          "torque_sampling",
          [](const Recording& r) {
            return r.info.torque_sampling == TorqueSampling::kHold ? "hold" : "instant";
          },
          "``hold`` or ``instant``.")
      .def_property_readonly(
          "passive", [](const Recording& r) { return r.info.passive; },
          "Joints whose torque is known to be zero.")
      .def_property_readonly(
          "period",
          [](const Recording& r) {
            return r.info.period > 0.0 ? py::object(py::float_(r.info.period)) : py::none();
          },
          "Of a periodic motion [s], or None.")
      .def_property_readonly(
          "torque_constant",
          [](const Recording& r) {
            return std::map<std::string, double>(r.info.torque_constant.begin(),
                                                 r.info.torque_constant.end());
          },
          "[N·m/A] or [N/A] by joint, where the recording knows them.")
      .def_property_readonly(
          "payload", [](const Recording& r) { return payload_dict(r.info.payload); },
          "The body that the robot held, as in a sidecar, or None.")
      .def_property_readonly(
          "controller",
          [](const Recording& r) {
            std::map<std::string, std::map<std::string, double>> out;
            for (const JointValue& v : r.info.controller) out[v.joint][v.name] = v.value;
            return out;
          },
          "Gains and limits of the controller per joint, where the recording knows them [SI "
          "units].")
      .def("__len__", &Recording::rows)
      .def("__getitem__", &rows_of, "rows"_a, "Consecutive rows: ``recording[:1000]``.")
      .def(
          "to_frame",
          [](const Recording& r) {
            return python_function("diffnea._frames", "recording_frame")(r);
          },
          "A pandas data frame with the columns of a recording file.")
      .def_static(
          "from_frame",
          [](const py::object& frame, const py::kwargs& options) {
            return python_function("diffnea._files", "recording_from_frame")(frame, **options);
          },
          "A recording from a data frame with the columns of a recording file: ``time``, "
          "``q_<joint>``, …")
      .def("__repr__", &recording_repr)
      .def(py::pickle(
          [](const Recording& r) {
            py::list extra;
            for (const ExtraChannel& e : r.extra)
              extra.append(py::make_tuple(e.name, array_out(e.values)));
            py::list controller;
            for (const JointValue& v : r.info.controller)
              controller.append(py::make_tuple(v.joint, v.name, v.value));
            py::list series;
            for (const auto member : kSeries) series.append(array_out(r.*member));
            return py::make_tuple(r.source, r.run, r.joint_names, array_out(r.time), series,
                                  r.has_tau, extra, static_cast<int>(r.info.torque_side),
                                  static_cast<int>(r.info.torque_sampling), r.info.period,
                                  r.info.passive, r.info.torque_constant, controller,
                                  payload_dict(r.info.payload));
          },
          [](const py::tuple& s) {
            Recording r;
            r.source = py::cast<std::string>(s[0]);
            r.run = py::cast<int>(s[1]);
            r.joint_names = py::cast<std::vector<std::string>>(s[2]);
            r.time = py::cast<VecX<double>>(s[3]);
            const py::list series = s[4];
            for (std::size_t k = 0; k < kSeries.size(); ++k)
              r.*kSeries[k] = py::cast<RowMatX<double>>(series[k]);
            r.has_tau = py::cast<std::vector<bool>>(s[5]);
            for (const auto& [name, values] :
                 py::cast<std::vector<std::pair<std::string, VecX<double>>>>(s[6]))
              r.extra.push_back({name, values});
            r.info.torque_side = static_cast<TorqueSide>(py::cast<int>(s[7]));
            r.info.torque_sampling = static_cast<TorqueSampling>(py::cast<int>(s[8]));
            r.info.period = py::cast<double>(s[9]);
            r.info.passive = py::cast<std::vector<std::string>>(s[10]);
            r.info.torque_constant = py::cast<std::vector<std::pair<std::string, double>>>(s[11]);
            for (const auto& [joint, name, value] :
                 py::cast<std::vector<std::tuple<std::string, std::string, double>>>(s[12]))
              r.info.controller.push_back({joint, name, value});
            r.info.payload = held_body(py::cast<std::optional<py::dict>>(s[13]));
            return r;
          }));
  c.attr("__module__") = "diffnea";
}

}  // namespace diffnea::python
