/// Trees under the constraints of their model: closed loops, wheels that roll.

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/driven_torques.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/tree_constraints.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "state_arrays.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// Result of constrained_forward_dynamics.
struct ConstrainedStates {
  py::array_t<double> qdd, force, multiplier, residual;
  std::vector<std::string> rows;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ConstrainedDynamics",
              "Accelerations of a model under its constraints, and what their m rows do.");
    list.field("qdd", &ConstrainedStates::qdd, "(n,) or (T, n).", {.unit = "rad/s², m/s²"});
    list.field("force", &ConstrainedStates::force,
               "(n,) or (T, n): torques of all constraints at the coordinates, −Jᵀλ.",
               {.unit = "N·m, N"});
    list.field("multiplier", &ConstrainedStates::multiplier,
               "(m,) or (T, m): λ of each row; 0 where others imply it.");
    list.field("residual", &ConstrainedStates::residual,
               "(m,) or (T, m): g of each row, 0 where it holds.");
    list.field("rows", &ConstrainedStates::rows,
               "The constraint that each row belongs to, a list of m names.");
  }
};

std::vector<int> held_coordinates(const Model& model, const std::vector<std::string>& joints) {
  std::vector<int> out;
  for (const std::string& joint : joints)
    out.push_back(find_joint(model, joint) + (model.free_base ? kBaseVelocities : 0));
  return out;
}

ConstrainedStates constrained_dynamics_of(const Model& model, const py::object& q,
                                          const py::object& qd, const py::object& tau, double kp,
                                          double kd) {
  const Lengths n(model);
  const States s =
      states_in("constrained_forward_dynamics", n.v,
                {n.positions("q", q), n.velocities("qd", qd), n.velocities("tau", tau)});
  ConstrainedStates out;
  RowMatX<double> qdd(s.rows(), n.v), force(s.rows(), n.v), multiplier, residual;
  Eigen::Index m = 0;
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    const TreeConstraints<double> constraints = tree_constraints(model);
    ConstrainedTreeWorkspace<double, double> ws;
    for (long k = 0; k < s.rows(); ++k) {
      qdd.row(k) = constrained_forward_dynamics<double, double>(
          tree, constraints, s.values[0].row(k).transpose(), s.values[1].row(k).transpose(),
          s.values[2].row(k).transpose(), {kp, kd}, ws);
      force.row(k) = ws.force;
      m = ws.multiplier.size();
      if (k == 0) {
        multiplier.resize(s.rows(), m);
        residual.resize(s.rows(), m);
        for (const ConstraintRow<double>& row : ws.constraints.rows) out.rows.push_back(row.name);
      }
      multiplier.row(k) = ws.multiplier;
      for (Eigen::Index i = 0; i < m; ++i)
        residual(k, i) = ws.constraints.rows[static_cast<std::size_t>(i)].g;
    }
  }
  out.qdd = s.shaped(std::move(qdd), {n.v});
  out.force = s.shaped(std::move(force), {n.v});
  out.multiplier = s.shaped(std::move(multiplier), {m});
  out.residual = s.shaped(std::move(residual), {m});
  return out;
}

py::array project_positions_of(const Model& model, const py::object& q,
                               const std::vector<std::string>& held) {
  constexpr double kClosed = 1e-9;  // [m, rad]
  const Lengths n(model);
  const States s = states_in("project_positions", n.q, {n.positions("q", q)});
  RowMatX<double> out(s.rows(), n.q);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    const TreeConstraints<double> constraints = tree_constraints(model);
    const ProjectionOptions options{.held = held_coordinates(model, held)};
    for (long k = 0; k < s.rows(); ++k) {
      const ProjectedPositions found =
          project_positions(tree, constraints, s.values[0].row(k).transpose(), options);
      if (!(found.residual <= kClosed))
        throw DataError(
            "project_positions: row " + std::to_string(k) +
            ": no posture near it meets the constraints: " + std::to_string(found.residual) +
            " m or rad remain after " + std::to_string(found.steps) +
            " steps; expected a posture nearer to the loop's closing" +
            (held.empty() ? "" : ", or fewer joints held"));
      out.row(k) = found.q;
    }
  }
  return s.shaped(std::move(out), {n.q});
}

py::array project_velocities_of(const Model& model, const py::object& q, const py::object& qd,
                                const std::vector<std::string>& held) {
  const Lengths n(model);
  const States s =
      states_in("project_velocities", n.v, {n.positions("q", q), n.velocities("qd", qd)});
  RowMatX<double> out(s.rows(), n.v);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    const TreeConstraints<double> constraints = tree_constraints(model);
    const std::vector<int> keep = held_coordinates(model, held);
    for (long k = 0; k < s.rows(); ++k)
      out.row(k) = project_velocities(tree, constraints, s.values[0].row(k).transpose(),
                                      s.values[1].row(k).transpose(), keep);
  }
  return s.shaped(std::move(out), {n.v});
}

py::array project_accelerations_of(const Model& model, const py::object& q, const py::object& qd,
                                   const py::object& qdd, const std::vector<std::string>& held) {
  const Lengths n(model);
  const States s =
      states_in("project_accelerations", n.v,
                {n.positions("q", q), n.velocities("qd", qd), n.velocities("qdd", qdd)});
  RowMatX<double> out(s.rows(), n.v);
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    const TreeConstraints<double> constraints = tree_constraints(model);
    const std::vector<int> keep = held_coordinates(model, held);
    for (long k = 0; k < s.rows(); ++k)
      out.row(k) = project_accelerations(tree, constraints, s.values[0].row(k).transpose(),
                                         s.values[1].row(k).transpose(),
                                         s.values[2].row(k).transpose(), keep);
  }
  return s.shaped(std::move(out), {n.v});
}

py::array constraint_jacobian_of(const Model& model, const py::object& q) {
  const Lengths n(model);
  const States s = states_in("constraint_jacobian", n.v, {n.positions("q", q)});
  RowMatX<double> out;
  Eigen::Index m = 0;
  {
    const py::gil_scoped_release release;
    const Tree<double> tree = make_tree(model);
    const TreeConstraints<double> constraints = tree_constraints(model);
    const VecX<double> still = VecX<double>::Zero(n.v);
    for (long k = 0; k < s.rows(); ++k) {
      const MatX<double> J = tree_rows(tree, constraints, s.values[0].row(k).transpose(), still).J;
      m = J.rows();
      if (k == 0) out.resize(s.rows() * m, n.v);
      out.middleRows(k * m, m) = J;
    }
  }
  return s.shaped(std::move(out), {m, n.v});
}

/// D of every row, with torques of driven joints = D · torques of the tree.
/// @throws DataError naming a row at which the driven joints do not hold all motions
class DrivenMaps {
 public:
  DrivenMaps(const char* where, const Model& model, const std::vector<std::string>& joints)
      : where_(where),
        tree_(make_tree(model)),
        constraints_(tree_constraints(model)),
        driven_(held_coordinates(model, joints)),
        still_(VecX<double>::Zero(tree_.num_velocities())) {}

  const Tree<double>& tree() const { return tree_; }
  MatX<double> at(long row, const VecX<double>& q) const {
    MatX<double> D = driven_map(tree_rows(tree_, constraints_, q, still_).J, driven_);
    if (D.rows() == 0)
      throw DataError(where_ + ": row " + std::to_string(row) +
                      ": the driven joints do not hold the robot: there are too few of them, or it "
                      "is at a dead point; expected as many as constraints leave motions");
    return D;
  }

 private:
  std::string where_;
  Tree<double> tree_;
  TreeConstraints<double> constraints_;
  std::vector<int> driven_;
  VecX<double> still_;
};

py::array driven_torques_of(const Model& model, const py::object& q, const py::object& qd,
                            const py::object& qdd, const std::vector<std::string>& driven) {
  const Lengths n(model);
  const States s =
      states_in("driven_torques", n.v,
                {n.positions("q", q), n.velocities("qd", qd), n.velocities("qdd", qdd)});
  const auto count = static_cast<long>(driven.size());
  RowMatX<double> out(s.rows(), count);
  {
    const py::gil_scoped_release release;
    const DrivenMaps maps("driven_torques", model, driven);
    RneaWorkspace<double, double> ws;
    for (long k = 0; k < s.rows(); ++k)
      out.row(k) =
          maps.at(k, s.values[0].row(k)) *
          rnea<double, double>(maps.tree(), s.values[0].row(k).transpose(),
                               s.values[1].row(k).transpose(), s.values[2].row(k).transpose(), ws);
  }
  return s.shaped(std::move(out), {count});
}

py::array driven_regressor_of(const Model& model, const py::object& q, const py::object& qd,
                              const py::object& qdd, const std::vector<std::string>& driven) {
  const Lengths n(model);
  const States s =
      states_in("driven_regressor", n.v,
                {n.positions("q", q), n.velocities("qd", qd), n.velocities("qdd", qdd)});
  const auto count = static_cast<long>(driven.size());
  const long columns = kThetaSize * static_cast<long>(tree_links(model).size());
  RowMatX<double> out(s.rows() * count, columns);
  {
    const py::gil_scoped_release release;
    const DrivenMaps maps("driven_regressor", model, driven);
    RegressorWorkspace<double, double> ws;
    for (long k = 0; k < s.rows(); ++k)
      out.middleRows(k * count, count) =
          maps.at(k, s.values[0].row(k)) *
          torque_regressor<double, double>(maps.tree(), s.values[0].row(k).transpose(),
                                           s.values[1].row(k).transpose(),
                                           s.values[2].row(k).transpose(), ws);
  }
  return s.shaped(std::move(out), {count, columns});
}

}  // namespace

void bind_loops(py::module_& m) {
  using C = ConstrainedStates;
  value_type<C>(m);
  m.def("constrained_forward_dynamics", &constrained_dynamics_of, "model"_a, py::kw_only(), "q"_a,
        "qd"_a, "tau"_a, "kp"_a = 0.0, "kd"_a = 0.0,
        "Accelerations under torques ``tau`` and the model's constraints (``model.constraints``), "
        "with the constraints'\nforces in closed form, as :class:`ConstrainedDynamics`.\n\n"
        "Shapes (n,) or (T, n), with a free base as for :func:`rnea`. ``kp`` [1/s²] and ``kd`` "
        "[1/s] pull drift back\n(Baumgarte 1972): 1/T² and 2/T for a time constant T. Effects do "
        "not act.\n\n"
        "Raises :class:`ModelError` naming constraints that contradict each other.");
  m.def("project_positions", &project_positions_of, "model"_a, py::kw_only(), "q"_a,
        "held"_a = std::vector<std::string>{},
        "Positions (n,) or (T, n) near ``q`` at which the model's constraints hold, to 1e-9 m or "
        "rad: Gauss–Newton.\n\n"
        "``held``: names of joints that keep their positions, as those that are driven. Raises "
        ":class:`DataError` naming\nthe row where nothing near it does.");
  m.def("project_velocities", &project_velocities_of, "model"_a, py::kw_only(), "q"_a, "qd"_a,
        "held"_a = std::vector<std::string>{},
        "The velocities (n,) or (T, n) nearest to ``qd`` that the model's constraints allow at "
        "``q``; ``held`` as for\n:func:`project_positions`.");
  m.def("project_accelerations", &project_accelerations_of, "model"_a, py::kw_only(), "q"_a, "qd"_a,
        "qdd"_a, "held"_a = std::vector<std::string>{},
        "The accelerations (n,) or (T, n) nearest to ``qdd`` that the model's constraints allow "
        "at ``(q, qd)``; ``held``\nas for :func:`project_positions`.");
  m.def("constraint_jacobian", &constraint_jacobian_of, "model"_a, py::kw_only(), "q"_a,
        "J, (m, n) or (T, m, n), with ġ = J qd of the m rows of the model's constraints; of a "
        "wheel's slip ∂g/∂qd. Empty,\n(0, n), without constraints.");
  m.def("driven_torques", &driven_torques_of, "model"_a, py::kw_only(), "q"_a, "qd"_a, "qdd"_a,
        "driven"_a,
        "Torques [N·m] of the joints ``driven``, (d,) or (T, d), that produce ``qdd`` at ``(q, "
        "qd)`` under the model's\nconstraints, all other joints without torque: inverse dynamics "
        "of a closed loop.\n\n"
        "``q``, ``qd``, ``qdd`` satisfy the constraints (:func:`project_positions` …); ``driven``: "
        "names of joints. With more\ndrives than motions, the shortest such torques. Raises "
        ":class:`DataError` naming the row where the driven joints\ndo not hold all motions (a "
        "dead point).");
  m.def("driven_regressor", &driven_regressor_of, "model"_a, py::kw_only(), "q"_a, "qd"_a, "qdd"_a,
        "driven"_a,
        "Y, (d, 10 links) or (T, d, 10 links), with :func:`driven_torques` = Y @ "
        "model.inertial_parameters, without\nrotor inertia. Arguments as there. Its row space is "
        "what torques of the driven joints can tell: base parameters\nof the loop.");
}

}  // namespace diffnea::python
