/// Bodies in maximal coordinates under constraints.

#include <cmath>

#include <diffnea/core/error.hpp>

#include "bindings.hpp"
#include "constraint_world.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

const std::map<BodyKind, const char*>& body_kinds() {
  static const std::map<BodyKind, const char*> kNames{{BodyKind::kRigid, "rigid"},
                                                      {BodyKind::kParticle, "particle"},
                                                      {BodyKind::kPrescribed, "prescribed"}};
  return kNames;
}

py::object parameter_out(const ParameterShape& shape, const std::vector<double>& numbers) {
  if (shape.shape.empty()) return py::float_(numbers[0]);
  return py::array_t<double>(shape.shape, numbers.data());
}

// --- what comes back

struct ConstrainedDerivatives {
  py::array_t<double> pose, twist, inertia;
  py::dict parameters;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ConstrainedDerivatives",
              "Derivatives of constrained accelerations (n, 6), at the active set that holds.");
    list.field("pose", &ConstrainedDerivatives::pose,
               "(n, 6, n, 6) by ξ of X exp(ξ), in the moved body's frame.");
    list.field("twist", &ConstrainedDerivatives::twist, "(n, 6, n, 6) by the twists.");
    list.field("inertia", &ConstrainedDerivatives::inertia,
               "(n, 6, n, 10) by the bodies' inertial parameters.");
    list.field(
        "parameters", &ConstrainedDerivatives::parameters,
        "By ``constraint.parameter``: (n, 6, k) for its k numbers; of a pose by ξ of X exp(ξ).");
  }
};
struct ConstrainedMotion {
  py::array_t<double> acceleration, force, multiplier, residual;
  std::vector<std::string> rows;
  py::array_t<bool> active, redundant;
  std::optional<ConstrainedDerivatives> derivatives;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ConstrainedMotion", "Accelerations of n bodies, and what m rows of constraints do.");
    list.field("acceleration", &ConstrainedMotion::acceleration,
               "(n, 6) derivative of the twist in the body's frame, angular first.",
               {.unit = "rad/s², m/s²"});
    list.field("force", &ConstrainedMotion::force,
               "(n, 6) of all constraints, in the body's frame.", {.unit = "N·m, N"});
    list.field("multiplier", &ConstrainedMotion::multiplier,
               "(m,) λ of each row; 0 where it does nothing.");
    list.field("residual", &ConstrainedMotion::residual, "(m,) g of each row: 0 where it holds.");
    list.field("rows", &ConstrainedMotion::rows,
               "The constraint that each row belongs to, a list of m names.");
    list.field("active", &ConstrainedMotion::active,
               "(m,) booleans: equalities, and inequalities that hold something back.");
    list.field("redundant", &ConstrainedMotion::redundant,
               "(m,) booleans: active, but implied by the others; the motion is unique, these "
               "forces are not.");
    list.field("derivatives", &ConstrainedMotion::derivatives,
               "A :class:`ConstrainedDerivatives` if it was asked for, else None.");
  }
};

py::array_t<double> columns(const RowMatX<double>& J, const std::vector<Eigen::Index>& which,
                            const std::vector<py::ssize_t>& shape) {
  RowMatX<double> out(J.rows(), static_cast<Eigen::Index>(which.size()));
  for (std::size_t c = 0; c < which.size(); ++c)
    out.col(static_cast<Eigen::Index>(c)) = J.col(which[c]);
  return array_out(std::move(out), shape);
}

ConstrainedDerivatives split(const World& w, const RowMatX<double>& J) {
  const py::ssize_t n = w.size();
  const auto of_bodies = [&](int offset, int count) {
    std::vector<Eigen::Index> which;
    for (py::ssize_t b = 0; b < n; ++b)
      for (int k = 0; k < count; ++k) which.push_back(b * kPerBody + offset + k);
    return columns(J, which, {n, 6, n, count});
  };
  ConstrainedDerivatives out{of_bodies(0, 6), of_bodies(6, 6), of_bodies(12, kThetaSize), {}};
  Eigen::Index next = n * kPerBody;
  for (const NamedConstraint& c : w.constraints)
    for (const ParameterShape& p : c.shapes) {
      std::vector<Eigen::Index> which;
      for (std::size_t k = 0; k < p.unknowns(); ++k) which.push_back(next++);
      out.parameters[py::str(c.name + "." + p.name)] = columns(J, which, {n, 6, std::ssize(which)});
    }
  return out;
}

/// @param where  the function, for messages
/// @throws ModelError naming a constraint that has no value or no derivative at the state
void require_numbers(const std::string& where, const std::vector<ConstraintRow<double>>& rows) {
  for (const ConstraintRow<double>& row : rows) {
    double sum = row.g + row.gd + row.bias;
    for (const Wrench<double>& J : row.J) sum += dot(J.torque, J.torque) + dot(J.force, J.force);
    if (!std::isfinite(sum))
      throw ModelError(
          where + ": constraint '" + row.name + "' has no " +
          (std::isfinite(row.g) ? "derivative" : "value") +
          " at these poses and twists: a division by 0, the root of 0 or the logarithm "
          "of less are none; write it so that it is smooth here");
  }
}

ConstrainedMotion constrained_acceleration_of(const std::vector<Body>& bodies,
                                              const std::vector<NamedConstraint>& constraints,
                                              const py::object& pose, const py::object& twist,
                                              const py::object& applied,
                                              const py::object& prescribed,
                                              const py::object& gravity, double kp, double kd,
                                              bool derivatives) {
  const std::string where = "constrained_acceleration";
  World w = world_in(where, bodies, constraints, pose, twist);
  w.applied = six_in(where + ": applied", applied, w.size());
  w.prescribed = six_in(where + ": prescribed", prescribed, w.size());
  const VecX<double> g = vector_in(where + ": gravity", gravity, 3);
  w.gravity = {g[0], g[1], g[2]};
  w.stabilisation = {kp, kd};

  Assembled<double> x;
  ConstrainedAcceleration<double> found;
  RowMatX<double> a(w.size(), 6), f(w.size(), 6), J;
  VecX<double> lambda, residual;
  std::vector<bool> active, redundant;
  {
    const py::gil_scoped_release release;
    x = assemble(w);
    require_numbers(where, x.rows);
    found = accelerate(w, x);
    for (std::size_t b = 0; b < w.bodies.size(); ++b) {
      const auto row = static_cast<Eigen::Index>(b);
      write_twist(found.Vd[b].angular, found.Vd[b].linear, a.row(row).data());
      write_twist(found.force[b].torque, found.force[b].force, f.row(row).data());
    }
    const auto m = static_cast<Eigen::Index>(x.rows.size());
    lambda.resize(m);
    residual.resize(m);
    for (std::size_t i = 0; i < x.rows.size(); ++i) {
      lambda[static_cast<Eigen::Index>(i)] = found.multiplier[i];
      residual[static_cast<Eigen::Index>(i)] = x.rows[i].g;
    }
    active = active_rows(x.rows, found.multiplier);
    redundant = redundant_rows(x.bodies, x.rows, found.multiplier);
    if (derivatives) J = acceleration_jacobian(w);
  }
  ConstrainedMotion out;
  out.acceleration = array_out(a);
  out.force = array_out(f);
  out.multiplier = array_out(lambda);
  out.residual = array_out(residual);
  for (const ConstraintRow<double>& row : x.rows) out.rows.push_back(row.name);
  out.active = array_out(active);
  out.redundant = array_out(redundant);
  if (derivatives) out.derivatives = split(w, J);
  return out;
}

py::array after_impact_of(const std::vector<Body>& bodies,
                          const std::vector<NamedConstraint>& constraints, const py::object& pose,
                          const py::object& twist, double restitution) {
  if (!(restitution >= 0.0 && restitution <= 1.0))
    throw Error("after_impact: restitution: got " + std::to_string(restitution) +
                ", expected 0 to 1");
  const World w = world_in("after_impact", bodies, constraints, pose, twist);
  RowMatX<double> out(w.size(), 6);
  {
    const py::gil_scoped_release release;
    const Assembled<double> x = assemble(w);
    require_numbers("after_impact", x.rows);
    const std::vector<Twist<double>> V = after_impact(x.bodies, x.states, x.rows, restitution);
    for (std::size_t b = 0; b < V.size(); ++b)
      write_twist(V[b].angular, V[b].linear, out.row(static_cast<Eigen::Index>(b)).data());
  }
  return array_out(out);
}

void bind_body(py::module_& m) {
  py::class_<Body> c(m, "FreeBody",
                     "A body in maximal coordinates: six numbers of motion, whatever joins it.\n\n"
                     "``inertia``: (10,) m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about its "
                     "origin, in its frame\n[kg, kg·m, kg·m²].");
  c.def(py::init([](const py::object& inertia) {
          Body b{BodyKind::kRigid, vector_in("FreeBody: inertia", inertia, kThetaSize)};
          if (!(b.theta[0] > 0.0))
            throw ModelError("FreeBody: got a mass of " + std::to_string(b.theta[0]) +
                             " kg, expected a positive one");
          return b;
        }),
        "inertia"_a)
      .def_static(
          "particle",
          [](double mass) {
            if (!(mass > 0.0))
              throw ModelError("FreeBody.particle: got a mass of " + std::to_string(mass) +
                               " kg, expected a positive one");
            Body b{BodyKind::kParticle, VecX<double>::Zero(kThetaSize)};
            b.theta[0] = mass;
            return b;
          },
          "mass"_a, "A mass [kg] alone: it never turns.")
      .def_static(
          "prescribed", [] { return Body{BodyKind::kPrescribed, VecX<double>::Zero(kThetaSize)}; },
          "A body whose motion is given: a driven pivot, a measured hand.")
      .def_property_readonly(
          "kind", [](const Body& b) { return body_kinds().at(b.kind); },
          "``rigid``, ``particle`` or ``prescribed``.")
      .def_property_readonly(
          "inertia", [](const Body& b) { return array_out(b.theta); },
          "(10,) about its origin, in its frame [kg, kg·m, kg·m²].")
      .def("__repr__",
           [](const Body& b) {
             const std::string kind = body_kinds().at(b.kind);
             if (b.kind == BodyKind::kPrescribed) return std::string("FreeBody.prescribed()");
             return "FreeBody(" + kind + ", mass=" + std::string(py::repr(py::float_(b.theta[0]))) +
                    ")";
           })
      .def(py::pickle(
          [](const Body& b) { return py::make_tuple(static_cast<int>(b.kind), b.theta); },
          [](const py::tuple& t) {
            return Body{static_cast<BodyKind>(t[0].cast<int>()), t[1].cast<VecX<double>>()};
          }));
  c.attr("__module__") = "diffnea";
}

py::tuple constraint_state(const NamedConstraint& x) {
  py::list shapes, steps;
  for (const ParameterShape& p : x.shapes)
    shapes.append(py::make_tuple(p.name, p.shape, p.unit, p.positive));
  if (!x.function)
    return py::make_tuple(x.kind, x.name, x.bodies, shapes, x.parameters, py::none());
  for (const Step& step : x.function->g.steps)
    steps.append(py::make_tuple(static_cast<int>(step.operation), step.a, step.b, step.constant));
  return py::make_tuple(x.kind, x.name, x.bodies, shapes, x.parameters,
                        py::make_tuple(steps, x.function->g.results, x.function->of_velocity,
                                       x.function->relation == Relation::kAtMost));
}

NamedConstraint constraint_of(const py::tuple& t) {
  NamedConstraint out{t[0].cast<std::string>(),
                      t[1].cast<std::string>(),
                      t[2].cast<std::vector<int>>(),
                      {},
                      t[4].cast<std::vector<std::vector<double>>>(),
                      nullptr};
  for (const py::handle of : t[3]) {
    const auto p = of.cast<py::tuple>();
    out.shapes.push_back({p[0].cast<std::string>(), p[1].cast<std::vector<py::ssize_t>>(),
                          p[2].cast<bool>(), p[3].cast<bool>()});
  }
  if (t[5].is_none()) return out;
  const auto its = t[5].cast<py::tuple>();
  TracedFunction f{{{}, its[1].cast<std::vector<int>>()},
                   its[2].cast<bool>(),
                   its[3].cast<bool>() ? Relation::kAtMost : Relation::kEqual};
  for (const py::handle of : its[0]) {
    const auto step = of.cast<py::tuple>();
    f.g.steps.push_back({static_cast<Operation>(step[0].cast<int>()), step[1].cast<int>(),
                         step[2].cast<int>(), step[3].cast<double>()});
  }
  out.function = std::make_shared<TracedFunction>(std::move(f));
  return out;
}

void bind_constraint(py::module_& m) {
  py::class_<NamedConstraint> c(
      m, "Constraint",
      "What ties a body to another, or to the world.\n\n"
      "``kind`` with its parameters; points in the bodies' frames A, B [m]; ``bodies``: (A, B) or "
      "B, indices,\nNone for the world:\n\n"
      "* ``rod``: ``p_AP``, ``p_BQ``, ``length``: points P and Q at this distance\n"
      "* ``string``: the same as an upper bound, it only pulls\n"
      "* ``ball_joint``: ``p_AP``, ``p_BQ``: the points coincide\n"
      "* ``hinge``: ``X_AJ``, ``X_BK``, (4, 4): the frames share origin and z axis\n"
      "* ``wheel_contact``: ``p_BC``, ``axle_B``, ``radius``: a thin wheel touches z = 0\n"
      "* ``rolling_wheel``: the same: where it touches it does not slip\n"
      "* ``skate``: ``p_BP``, ``across_B``: no velocity of P along ``across_B``\n\n"
      "Or ``kind`` is a function ``g(X, **parameters)``, ``g(X, V, **parameters)`` if it is of "
      "velocities: ``X`` (n, 4, 4)\nare the poses of ``bodies`` in the world, ``V`` (n, 6) "
      "their twists in their own frames, angular first, and it\nreturns g, a number or a list. "
      "``relation``: ``equal``, g = 0, or ``at_most``, g <= 0. Parameters are numbers\nand "
      "arrays; (4, 4) is a pose. It is called once, with symbols: arithmetic, ``@`` and numpy's "
      "``sqrt``, ``exp``,\n``log``, ``sin``, ``cos``, ``tan``, ``arcsin``, ``arccos``, "
      "``arctan``, ``arctan2``, ``hypot``, ``cross``, ``linalg.norm``\nwork on them; a comparison "
      "raises :class:`Error`.\n\n"
      "``name``: as errors and results name it, the kind's or the function's by default.");
  c.def(py::init([](const py::object& kind, const py::object& bodies, const std::string& name,
                    const std::string& relation, const py::kwargs& parameters) {
          return constraint_in(kind, bodies, name, relation, parameters);
        }),
        "kind"_a, "bodies"_a, "name"_a = "", py::kw_only(), "relation"_a = "equal")
      .def_property_readonly(
          "kind", [](const NamedConstraint& x) { return x.kind; },
          "``rod``, ``string`` …, or the name of the function.")
      .def_property_readonly(
          "name", [](const NamedConstraint& x) { return x.name; }, "As errors name it.")
      .def_property_readonly(
          "bodies", [](const NamedConstraint& x) { return bodies_out(x.bodies); },
          "Indices; None: the world.")
      .def_property_readonly(
          "parameters",
          [](const NamedConstraint& x) {
            py::dict out;
            for (std::size_t p = 0; p < x.parameters.size(); ++p)
              out[x.shapes[p].name.c_str()] = parameter_out(x.shapes[p], x.parameters[p]);
            return out;
          },
          "By name: numbers and arrays.")
      .def("__repr__",
           [](const py::object& self) {
             return "Constraint(" + std::string(py::repr(self.attr("kind"))) + ", " +
                    std::string(py::repr(self.attr("bodies"))) +
                    ", name=" + std::string(py::repr(self.attr("name"))) + ")";
           })
      .def(py::pickle(&constraint_state, &constraint_of));
  c.attr("__module__") = "diffnea";
}

}  // namespace

void bind_constraints(py::module_& m) {
  bind_body(m);
  bind_constraint(m);
  using D = ConstrainedDerivatives;
  value_type<D>(m);
  using M = ConstrainedMotion;
  value_type<M>(m);
  m.def("constrained_acceleration", &constrained_acceleration_of, "bodies"_a, "constraints"_a,
        py::kw_only(), "pose"_a, "twist"_a = py::none(), "applied"_a = py::none(),
        "prescribed"_a = py::none(), "gravity"_a = py::make_tuple(0.0, 0.0, -9.81), "kp"_a = 0.0,
        "kd"_a = 0.0, "derivatives"_a = false,
        "Accelerations of n bodies under constraints, and the constraints' forces, as "
        ":class:`ConstrainedMotion`.\n\n"
        "``pose``: (n, 4, 4) of each body in the world [m]; ``twist``: (n, 6) of it, in its own "
        "frame, angular first\n[rad/s, m/s]; ``applied``: (n, 6) wrenches in its frame, weight not "
        "among them [N·m, N]; ``prescribed``: (n, 6)\naccelerations of prescribed bodies; "
        "``gravity``: (3,) in the world [m/s²]. ``kp`` [1/s²] and ``kd`` [1/s] pull\ndrift back "
        "(Baumgarte 1972). ``derivatives=True``: by state, inertia and constraints' parameters "
        "too.\n\n"
        "Raises :class:`ModelError` naming the constraints that contradict each other.");
  m.def("after_impact", &after_impact_of, "bodies"_a, "constraints"_a, py::kw_only(), "pose"_a,
        "twist"_a, "restitution"_a = 0.0,
        "Twists (n, 6) after an impact: constraints that are violated or touch end with no "
        "velocity against them.\n\n"
        "Arguments as for :func:`constrained_acceleration`; a string that becomes taut gives back "
        "``restitution`` times\nthe velocity along it. Momentum changes along the constraints "
        "alone (Moreau 1988).");
}

}  // namespace diffnea::python
