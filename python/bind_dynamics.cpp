/// Dynamics and kinematics of one state or of many, one a row.

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/model/free_base.hpp>
#include <diffnea/model/model.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "state_arrays.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// Positions one step on, of a free base on the manifold of poses.
py::array integrate_of(const Model& model, const py::object& q, const py::object& v) {
  const Lengths n(model);
  const States s = states_in("integrate", n.v, {n.positions("q", q), n.velocities("v", v)});
  RowMatX<double> out(s.rows(), n.q);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    for (long k = 0; k < s.rows(); ++k)
      out.row(k) = integrate<double, double>(tree, s.values[0].row(k), s.values[1].row(k));
  }
  return s.shaped(std::move(out), {n.q});
}

py::array difference_of(const Model& model, const py::object& from, const py::object& to) {
  const Lengths n(model);
  const States s = states_in("difference", n.v, {n.positions("q0", from), n.positions("q1", to)});
  RowMatX<double> out(s.rows(), n.v);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    for (long k = 0; k < s.rows(); ++k)
      out.row(k) = difference<double, double>(tree, s.values[0].row(k), s.values[1].row(k));
  }
  return s.shaped(std::move(out), {n.v});
}

py::array inverse(const Model& model, const py::object& q, const py::object& qd,
                  const py::object& qdd, bool effects, int threads) {
  const Lengths n(model);
  const States s = states_in(
      "rnea", n.v, {n.positions("q", q), n.velocities("qd", qd), n.velocities("qdd", qdd)});
  RowMatX<double> tau;
  {
    const py::gil_scoped_release release;
    tau = effects ? inverse_dynamics(extend(model), s.values[0], s.values[1], s.values[2])
                  : rnea_batch(make_tree(model), s.values[0], s.values[1], s.values[2],
                               {.num_threads = threads, .instruction_set = ""});
  }
  return s.shaped(std::move(tau), {n.v});
}

py::array forward(const Model& model, const py::object& q, const py::object& qd,
                  const py::object& tau, bool effects, int threads) {
  if (!model.constraints.empty())
    throw ModelError("aba: '" + model.name +
                     "' has constraints, whose forces aba leaves out; "
                     "constrained_forward_dynamics takes them");
  const Lengths n(model);
  const States s = states_in(
      "aba", n.v, {n.positions("q", q), n.velocities("qd", qd), n.velocities("tau", tau)});
  RowMatX<double> qdd(s.rows(), n.v);
  {
    const py::gil_scoped_release release;
    if (effects) {
      ForwardDynamics dynamics(extend(model));
      for (const BoundEffect& e : dynamics.model().effects)
        if (reads_time(e))
          throw ModelError("aba: the torque of " + e.info().name + " at '" + e.where +
                           "' depends on the time since the run began; expected a model without "
                           "such effects (`simulate` knows the time)");
      for (long k = 0; k < s.rows(); ++k)
        dynamics.acceleration(s.values[0].row(k).data(), s.values[1].row(k).data(),
                              s.values[2].row(k).data(), /*run=*/0, qdd.row(k).data());
    } else {
      qdd = aba_batch(make_tree(model), s.values[0], s.values[1], s.values[2],
                      {.num_threads = threads, .instruction_set = ""});
    }
  }
  if (!qdd.allFinite())
    for (const ModelIssue& issue : check_model(model))
      if (issue.text.find("no inertia") != std::string::npos)
        throw ModelError("aba: link '" + issue.link + "': " + issue.text);
  return s.shaped(std::move(qdd), {n.v});
}

py::array torque_regressor_of(const Model& model, const py::object& q, const py::object& qd,
                              const py::object& qdd, int threads) {
  const Lengths n(model);
  const States s = states_in(
      "regressor", n.v, {n.positions("q", q), n.velocities("qd", qd), n.velocities("qdd", qdd)});
  RowMatX<double> Y;
  {
    const py::gil_scoped_release release;
    Y = regressor_batch(make_tree(model), s.values[0], s.values[1], s.values[2],
                        {.num_threads = threads, .instruction_set = ""});
  }
  return s.shaped(std::move(Y), {n.v, kThetaSize * static_cast<long>(tree_links(model).size())});
}

py::array mass_matrix_of(const Model& model, const py::object& q) {
  const Lengths lengths(model);
  const long n = lengths.v;
  const States s = states_in("mass_matrix", n, {lengths.positions("q", q)});
  RowMatX<double> out(s.rows() * n, n);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    MassMatrixWorkspace<double, double> ws;
    for (long k = 0; k < s.rows(); ++k)
      out.middleRows(k * n, n) =
          mass_matrix<double, double>(tree, s.values[0].row(k).transpose(), ws);
  }
  return s.shaped(std::move(out), {n, n});
}

py::array gravity_torques_of(const Model& model, const py::object& q) {
  const Lengths lengths(model);
  const long n = lengths.v;
  const States s = states_in("gravity_torques", n, {lengths.positions("q", q)});
  RowMatX<double> tau;
  {
    const py::gil_scoped_release release;
    const RowMatX<double> zero = RowMatX<double>::Zero(s.rows(), n);
    tau = rnea_batch(make_tree(model), s.values[0], zero, zero);
  }
  return s.shaped(std::move(tau), {n});
}

py::tuple inverse_derivatives(const Model& model, const py::object& q, const py::object& qd,
                              const py::object& qdd) {
  const Lengths lengths(model);
  const long n = lengths.v;
  const States s = states_in(
      "rnea_derivatives", n,
      {lengths.positions("q", q), lengths.velocities("qd", qd), lengths.velocities("qdd", qdd)});
  RowMatX<double> dq(s.rows() * n, n), dqd(s.rows() * n, n), M(s.rows() * n, n);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    RneaDerivatives d;
    for (long k = 0; k < s.rows(); ++k) {
      rnea_derivatives(tree, s.values[0].row(k).transpose(), s.values[1].row(k).transpose(),
                       s.values[2].row(k).transpose(), d);
      dq.middleRows(k * n, n) = d.dtau_dq;
      dqd.middleRows(k * n, n) = d.dtau_dqd;
      M.middleRows(k * n, n) = d.M;
    }
  }
  return py::make_tuple(s.shaped(std::move(dq), {n, n}), s.shaped(std::move(dqd), {n, n}),
                        s.shaped(std::move(M), {n, n}));
}

/// Degree of freedom that moves a frame, −1 for the world, and the frame's pose in that link.
struct FramePlace {
  int dof = -1;
  Pose<double> X_LF = Pose<double>::identity();
};

FramePlace find_frame(const Model& model, const std::string& name) {
  const TreeMap map = map_to_tree(model);
  std::string known;
  for (const ModelFrame& f : model.frames) {
    if (f.name != name) {
      known += f.name + ", ";
      continue;
    }
    if (f.link < 0) return {-1, f.X_LF};
    const std::size_t link = static_cast<std::size_t>(f.link);
    return {map.dof[link], map.X_LF[link] * f.X_LF};
  }
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    if (model.links[i].name == name) return {map.dof[i], map.X_LF[i]};
    known += model.links[i].name + ", ";
  }
  throw ModelError(model.name + ": there is no frame '" + name +
                   "'; frames and links: " + known.substr(0, known.size() - 2));
}

void write_pose(const Pose<double>& X, double* out) {
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> H(out);
  H.setIdentity();
  H.topLeftCorner<3, 3>() = to_eigen(X.R);
  H.topRightCorner<3, 1>() = to_eigen(X.p);
}

py::array frame_pose_of(const Model& model, const std::string& frame, const py::object& q) {
  const FramePlace place = find_frame(model, frame);
  const States s = states_in("frame_pose", -1, {Lengths(model).positions("q", q)});
  RowMatX<double> out(s.rows(), 16);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    LinkKinematics<double> kinematics;
    for (long k = 0; k < s.rows(); ++k) {
      forward_kinematics<double, double>(tree, s.values[0].row(k).transpose(), kinematics);
      write_pose(frame_pose(kinematics, place.dof, place.X_LF), out.row(k).data());
    }
  }
  return s.shaped(std::move(out), {4, 4});
}

/// FrameMotion as arrays.
struct FrameMotionArrays {
  py::array_t<double> pose, velocity, angular_velocity, acceleration, angular_acceleration;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("FrameMotion", "Motion of a frame against the world, expressed in the world.");
    list.field("pose", &FrameMotionArrays::pose, "(…, 4, 4) homogeneous transform; position.",
               {.unit = "m"});
    list.field("velocity", &FrameMotionArrays::velocity, "(…, 3) of the origin.", {.unit = "m/s"});
    list.field("angular_velocity", &FrameMotionArrays::angular_velocity, "(…, 3).",
               {.unit = "rad/s"});
    list.field("acceleration", &FrameMotionArrays::acceleration, "(…, 3) of the origin.",
               {.unit = "m/s²"});
    list.field("angular_acceleration", &FrameMotionArrays::angular_acceleration, "(…, 3).",
               {.unit = "rad/s²"});
  }
};

FrameMotionArrays frame_motion_of(const Model& model, const std::string& frame, const py::object& q,
                                  const py::object& qd, const py::object& qdd) {
  const FramePlace place = find_frame(model, frame);
  const Lengths n(model);
  const States s = states_in(
      "frame_motion", n.v, {n.positions("q", q), n.velocities("qd", qd), n.velocities("qdd", qdd)});
  RowMatX<double> pose(s.rows(), 16), v(s.rows(), 3), w(s.rows(), 3), a(s.rows(), 3),
      alpha(s.rows(), 3);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    LinkKinematics<double> kinematics;
    for (long k = 0; k < s.rows(); ++k) {
      forward_kinematics<double, double>(tree, s.values[0].row(k).transpose(),
                                         s.values[1].row(k).transpose(),
                                         s.values[2].row(k).transpose(), kinematics);
      const FrameMotion<double> m = frame_motion(kinematics, place.dof, place.X_LF);
      write_pose(m.X_WF, pose.row(k).data());
      v.row(k) = to_eigen(m.velocity);
      w.row(k) = to_eigen(m.angular_velocity);
      a.row(k) = to_eigen(m.acceleration);
      alpha.row(k) = to_eigen(m.angular_acceleration);
    }
  }
  return {s.shaped(std::move(pose), {4, 4}), s.shaped(std::move(v), {3}),
          s.shaped(std::move(w), {3}), s.shaped(std::move(a), {3}),
          s.shaped(std::move(alpha), {3})};
}

py::array frame_jacobian_of(const Model& model, const std::string& frame, const py::object& q) {
  const FramePlace place = find_frame(model, frame);
  const Lengths lengths(model);
  const long n = lengths.v;
  const States s = states_in("frame_jacobian", n, {lengths.positions("q", q)});
  RowMatX<double> out(s.rows() * 6, n);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    LinkKinematics<double> kinematics;
    MatX<double> J;
    for (long k = 0; k < s.rows(); ++k) {
      forward_kinematics<double, double>(tree, s.values[0].row(k).transpose(), kinematics);
      frame_jacobian(tree, kinematics, place.dof, place.X_LF, J);
      out.middleRows(k * 6, 6) = J;
    }
  }
  return s.shaped(std::move(out), {6, n});
}

}  // namespace

void bind_dynamics(py::module_& m) {
  m.def(
      "rnea", &inverse, "model"_a, py::kw_only(), "q"_a, "qd"_a, "qdd"_a, "effects"_a = false,
      "threads"_a = 1,
      "Joint torques [N·m] that produce ``qdd`` at ``(q, qd)``: inverse dynamics, rotor inertia "
      "included.\n\n"
      "``q`` [rad], ``qd`` [rad/s], ``qdd`` [rad/s²] ([m …] and [N] where prismatic): (n,), or "
      "(T, n) with one\n"
      "state a row; the result has the same shape. ``effects=True`` adds friction, springs, "
      "offsets and payloads\n"
      "of the model: what the drives' sensors read. ``threads``: rows are divided among as many "
      "(without effects).\n\n"
      "With a free base (``model.free_base``) ``q`` is (7 + n,): the base's position [m] and its "
      "unit quaternion\n"
      "``[x y z qx qy qz qw]``, then the joints. ``qd``, ``qdd`` and the result are (6 + n,): the "
      "base's twist\n"
      "``[ω; v]`` [rad/s, m/s], its derivative and the wrench ``[τ; f]`` [N·m, N] that it needs, "
      "all about the\n"
      "base's origin in the base's axes, then the joints. (ẍ of that origin is R (v̇ + ω×v).) "
      "Effects act at\n"
      "its joints; those on links are refused.\n\n"
      "Of a model with constraints these are the torques of its tree: constraints add Jᵀλ.");
  m.def(
      "aba", &forward, "model"_a, py::kw_only(), "q"_a, "qd"_a, "tau"_a, "effects"_a = false,
      "threads"_a = 1,
      "Joint accelerations [rad/s²] under torques ``tau`` [N·m] at ``(q, qd)``: forward "
      "dynamics.\n\n"
      "Shapes (n,) or (T, n), as for :func:`rnea`, whose inverse it is; the wrench on a free base "
      "is zero in the air.\n"
      "``effects=True``: friction, springs and offsets of the model act too. A model with "
      "constraints is refused:\n:func:`constrained_forward_dynamics` takes it.");
  m.def(
      "regressor", &torque_regressor_of, "model"_a, py::kw_only(), "q"_a, "qd"_a, "qdd"_a,
      "threads"_a = 1,
      "Y(q, qd, qdd), (n, 10 links) or (T, n, 10 links): ``rnea`` = Y @ "
      "model.inertial_parameters + "
      "armature * qdd.\n\n"
      "Row units [N·m] per [kg, kg·m, kg·m²]. Reads the tree's geometry, not its inertias. With a "
      "free base\n(6 + n, 10 links): rows of the wrench on it and columns of its inertia come "
      "first.");
  m.def(
      "mass_matrix", &mass_matrix_of, "model"_a, py::kw_only(), "q"_a,
      "M(q), (n, n) or (T, n, n), rotor inertia on the diagonal [kg·m²; kg where prismatic]. With "
      "a free base\n(6 + n, 6 + n), its twist first.");
  m.def("gravity_torques", &gravity_torques_of, "model"_a, py::kw_only(), "q"_a,
        "Torques [N·m] that hold the robot still at ``q``: (n,) or (T, n); of a free base the "
        "wrench first, (6 + n,).");
  m.def(
      "integrate", &integrate_of, "model"_a, py::kw_only(), "q"_a, "v"_a,
      "Positions after a step ``v`` = velocity times duration: q + v, and of a free base the pose "
      "X exp(V).\n\n"
      "``q``: (n,) or (T, n), with a free base (7 + n,); ``v``: (n,), with a free base (6 + n,). "
      "Returns the shape\nof ``q``, the quaternion with norm 1.");
  m.def("difference", &difference_of, "model"_a, py::kw_only(), "q0"_a, "q1"_a,
        "The ``v`` with ``integrate(model, q=q0, v=v) == q1``: (n,) or (T, n), with a free base "
        "(6 + n,); turns by\nat most π.");
  m.def("rnea_derivatives", &inverse_derivatives, "model"_a, py::kw_only(), "q"_a, "qd"_a, "qdd"_a,
        "Derivatives of :func:`rnea` with respect to q [N·m/rad], qd [N·m·s/rad] and qdd (the mass "
        "matrix).\n\n"
        "Three arrays (n, n) or (T, n, n); row: torque, column: joint. Effects are not in them. "
        "With a "
        "free base\n(6 + n, 6 + n); derivatives by the base's pose are those by the ``v`` of "
        ":func:`integrate`.");
  value_type<FrameMotionArrays>(m);
  m.def("frame_pose", &frame_pose_of, "model"_a, "frame"_a, py::kw_only(), "q"_a,
        "Pose of a frame or link in the world, (4, 4) or (T, 4, 4); position [m].");
  m.def("frame_motion", &frame_motion_of, "model"_a, "frame"_a, py::kw_only(), "q"_a, "qd"_a,
        "qdd"_a,
        "Pose, velocity and acceleration of a frame or link, as :class:`FrameMotion`. Gravity is "
        "not in them.");
  m.def("frame_jacobian", &frame_jacobian_of, "model"_a, "frame"_a, py::kw_only(), "q"_a,
        "J, (6, n) or (T, 6, n), with [angular velocity; velocity of the origin] = J qd, in the "
        "world; (6, 6 + n) with\na free base.");
}

}  // namespace diffnea::python
