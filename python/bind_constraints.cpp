/// Bodies in maximal coordinates under constraints.

#include <map>
#include <optional>

#include <Eigen/LU>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/constraints.hpp>

#include "arrays.hpp"
#include "bindings.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

// --- bodies and constraints as Python holds them

struct Body {
  BodyKind kind = BodyKind::kRigid;
  VecX<double> theta = VecX<double>::Zero(kThetaSize);
};

const std::map<BodyKind, const char*>& body_kinds() {
  static const std::map<BodyKind, const char*> kNames{{BodyKind::kRigid, "rigid"},
                                                      {BodyKind::kParticle, "particle"},
                                                      {BodyKind::kPrescribed, "prescribed"}};
  return kNames;
}

/// A parameter's size: 1 a number, 3 a vector, 16 a pose.
struct ParameterShape {
  const char* name;
  int size;
  bool unit = false;  ///< a vector of length 1
};
struct ConstraintShape {
  std::size_t bodies;
  std::vector<ParameterShape> parameters;
};

const std::map<std::string, ConstraintShape>& constraint_kinds() {
  static const std::map<std::string, ConstraintShape> kKinds{
      {"rod", {2, {{"p_AP", 3}, {"p_BQ", 3}, {"length", 1}}}},
      {"string", {2, {{"p_AP", 3}, {"p_BQ", 3}, {"length", 1}}}},
      {"ball_joint", {2, {{"p_AP", 3}, {"p_BQ", 3}}}},
      {"hinge", {2, {{"X_AJ", 16}, {"X_BK", 16}}}},
      {"wheel_contact", {1, {{"p_BC", 3}, {"axle_B", 3, true}, {"radius", 1}}}},
      {"rolling_wheel", {1, {{"p_BC", 3}, {"axle_B", 3, true}, {"radius", 1}}}},
      {"skate", {1, {{"p_BP", 3}, {"across_B", 3, true}}}}};
  return kKinds;
}

struct NamedConstraint {
  std::string kind, name;
  std::vector<int> bodies;                      ///< kWorld for the world
  std::vector<std::vector<double>> parameters;  ///< in the order of the kind's

  const ConstraintShape& shape() const { return constraint_kinds().at(kind); }
};

Pose<double> pose_in(const std::string& what, const double* H) {
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(H);
  const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
  if (!((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-6) || R.determinant() < 0.0)
    throw ModelError(what + ": its rotation is none (R^T R = 1, det R = 1 expected)");
  return {mat3<double>(R), vec3<double>(Eigen::Vector3d(X.topRightCorner<3, 1>()))};
}

std::vector<int> bodies_in(const std::string& what, const py::object& given, std::size_t expected) {
  std::vector<int> out;
  const auto take = [&](const py::handle& b) {
    out.push_back(b.is_none() ? kWorld : b.cast<int>());
    if (out.back() < kWorld)
      throw ShapeError(what + ": bodies: got " + std::to_string(out.back()) +
                       ", expected an index from 0, or None for the world");
  };
  if (given.is_none() || py::isinstance<py::int_>(given))
    take(given);
  else
    for (const py::handle b : given) take(b);
  if (out.size() != expected)
    throw ShapeError(what + ": bodies: got " + std::to_string(out.size()) + ", expected " +
                     std::to_string(expected));
  return out;
}

NamedConstraint constraint_in(const std::string& kind, const py::object& bodies,
                              const std::string& name, const py::kwargs& given) {
  const auto found = constraint_kinds().find(kind);
  std::string choices;
  for (const auto& [known, shape] : constraint_kinds())
    choices += (choices.empty() ? "" : ", ") + known;
  if (found == constraint_kinds().end())
    throw Error("Constraint: kind: got '" + kind + "'; choices: " + choices);
  NamedConstraint out{kind, name.empty() ? kind : name, {}, {}};
  const std::string what = "Constraint '" + out.name + "' (" + kind + ")";
  const ConstraintShape& shape = found->second;
  out.bodies = bodies_in(what, bodies, shape.bodies);
  std::string names;
  for (const ParameterShape& p : shape.parameters)
    names += (names.empty() ? "" : ", ") + std::string(p.name);
  for (const auto& [key, value] : given)
    if (std::ranges::none_of(shape.parameters, [&](const ParameterShape& p) {
          return p.name == key.cast<std::string>();
        }))
      throw Error(what + ": got parameter '" + key.cast<std::string>() + "'; parameters: " + names);
  for (const ParameterShape& p : shape.parameters) {
    const std::string where = what + ": " + p.name;
    if (!given.contains(p.name)) throw Error(where + " is missing; parameters: " + names);
    const py::object value = given[p.name];
    std::vector<double> numbers;
    if (p.size == 1) {
      numbers = {value.cast<double>()};
      if (!(numbers[0] > 0.0))
        throw ModelError(where + ": got " + std::to_string(numbers[0]) +
                         " m, expected more than 0");
    } else if (p.size == 3) {
      const VecX<double> v = vector_in(where, value, 3);
      numbers.assign(v.begin(), v.end());
      if (p.unit && !(std::abs(v.norm() - 1.0) < 1e-6))
        throw ModelError(where + ": got a vector of length " + std::to_string(v.norm()) +
                         ", expected a unit vector");
    } else {
      const RowMatX<double> H = matrix_in(where, value, 4, 4);
      numbers.assign(H.data(), H.data() + 16);
      pose_in(where, numbers.data());
    }
    out.parameters.push_back(std::move(numbers));
  }
  return out;
}

py::object parameter_out(const ParameterShape& shape, const std::vector<double>& numbers) {
  if (shape.size == 1) return py::float_(numbers[0]);
  if (shape.size == 3) return array_out(numbers);
  return py::array_t<double>({4, 4}, numbers.data());
}

// --- the same for any scalar, with what derivatives are taken of seeded one after the other

/// Unknown number k is a variable of this sweep if first ≤ k < first + kJetWidth.
template <class T>
struct Seeds {
  int first = 0, next = 0;
  T operator()(double x) {
    const int k = next++ - first;
    if constexpr (std::is_same_v<T, JetD>)
      return k >= 0 && k < kJetWidth ? JetD(x, k) : JetD(x);
    else
      return x;
  }
  Vec3<T> vector(const double* x) {
    Vec3<T> out;
    out.x = (*this)(x[0]);
    out.y = (*this)(x[1]);
    out.z = (*this)(x[2]);
    return out;
  }
  /// X exp(ξ) about ξ = 0, six unknowns, angular first.
  Pose<T> pose(const Pose<double>& X) {
    constexpr double kNone[3] = {0.0, 0.0, 0.0};
    const Vec3<T> w = vector(kNone), v = vector(kNone);
    const Mat3<T> R = X.R.cast<T>();
    Mat3<T> turned = R;
    for (int j = 0; j < 3; ++j)
      turned.col[j] = turned.col[j] + R * cross(w, Mat3<T>::identity().col[j]);
    return {turned, X.p.cast<T>() + R * v};
  }
};

struct World {
  std::vector<Body> bodies;
  std::vector<NamedConstraint> constraints;
  std::vector<Pose<double>> poses;
  RowMatX<double> twists, applied, prescribed;  ///< (n, 6)
  Vec3<double> gravity{0, 0, 0};
  Stabilisation stabilisation;

  long size() const { return static_cast<long>(bodies.size()); }
};

constexpr int kPerBody = 6 + 6 + kThetaSize;  ///< unknowns: pose, twist, inertia

template <class T>
void append(const NamedConstraint& c, Seeds<T>& seed, const std::vector<BodyState<T>>& states,
            std::vector<ConstraintRow<T>>& rows) {
  const auto& p = c.parameters;
  const auto vector = [&](std::size_t i) { return seed.vector(p[i].data()); };
  const auto number = [&](std::size_t i) { return seed(p[i][0]); };
  const auto two = [&](const auto& constraint) {
    append_rows(constraint, c.name, {c.bodies[0], c.bodies[1]}, states, rows);
  };
  const auto one = [&](const auto& constraint) {
    append_rows(constraint, c.name, {c.bodies[0]}, states, rows);
  };
  if (c.kind == "hinge") {
    const Pose<T> J = seed.pose(pose_in(c.name, p[0].data()));
    const Pose<T> K = seed.pose(pose_in(c.name, p[1].data()));
    return two(Hinge<T>{J, K});
  }
  const Vec3<T> a = vector(0), b = vector(1);
  if (c.kind == "ball_joint") return two(BallJoint<T>{a, b});
  if (c.kind == "skate") return one(Skate<T>{a, b});
  const T length = number(2);
  if (c.kind == "rod") return two(Rod<T>{a, b, length});
  if (c.kind == "string") return two(String<T>{{a, b, length}});
  if (c.kind == "wheel_contact") return one(WheelContact<T>{a, b, length});
  return one(RollingWheel<T>{a, b, length});
}

template <class T>
Twist<T> twist_of(const double* x) {
  return {{T(x[0]), T(x[1]), T(x[2])}, {T(x[3]), T(x[4]), T(x[5])}};
}

template <class T>
struct Assembled {
  std::vector<FreeBody<T>> bodies;
  std::vector<BodyState<T>> states;
  std::vector<ConstraintRow<T>> rows;
  int unknowns = 0;
};

/// @param without  index of a constraint that is left out; −1: none
template <class T>
Assembled<T> assemble(const World& w, int first, int without = -1) {
  Seeds<T> seed{first, 0};
  Assembled<T> out;
  for (std::size_t b = 0; b < w.bodies.size(); ++b) {
    BodyState<T> state;
    state.X_WB = seed.pose(w.poses[b]);
    const double* V = w.twists.row(static_cast<Eigen::Index>(b)).data();
    state.V.angular = seed.vector(V);
    state.V.linear = seed.vector(V + 3);
    out.states.push_back(state);
    Theta<T> theta;
    for (std::size_t k = 0; k < kThetaSize; ++k)
      theta[k] = seed(w.bodies[b].theta[static_cast<Eigen::Index>(k)]);
    out.bodies.push_back({w.bodies[b].kind, SpatialInertia<T>::from_theta(theta)});
  }
  for (std::size_t c = 0; c < w.constraints.size(); ++c)
    if (static_cast<int>(c) != without) append(w.constraints[c], seed, out.states, out.rows);
  out.unknowns = seed.next;
  return out;
}

template <class T>
ConstrainedAcceleration<T> accelerate(const World& w, const Assembled<T>& x) {
  std::vector<Wrench<T>> applied;
  std::vector<Twist<T>> prescribed;
  for (Eigen::Index b = 0; b < w.size(); ++b) {
    const Twist<T> f = twist_of<T>(w.applied.row(b).data());
    applied.push_back({f.angular, f.linear});
    prescribed.push_back(twist_of<T>(w.prescribed.row(b).data()));
  }
  return constrained_acceleration<T>(x.bodies, x.states, applied, prescribed, x.rows,
                                     w.gravity.cast<T>(), w.stabilisation);
}

/// What `solve` throws of constraints that contradict each other, with those named without which
/// the others agree. @param solve  of a world without one constraint (index, or −1)
template <class Solve>
auto naming_contradictions(const World& w, const Solve& solve) {
  try {
    return solve(-1);
  } catch (const ModelError& error) {
    const std::string text = error.what();
    if (text.find("contradicts") == text.npos && text.find("no choice") == text.npos) throw;
    std::string names;
    for (std::size_t c = 0; c < w.constraints.size(); ++c) {
      try {
        solve(static_cast<int>(c));
        names += (names.empty() ? "'" : " or '") + w.constraints[c].name + "'";
      } catch (const ModelError&) {
        continue;  // its absence does not help
      }
    }
    throw ModelError(text + (names.empty() ? "" : "; the others agree without " + names));
  }
}

// --- what comes back

struct ConstrainedDerivatives {
  py::array_t<double> pose, twist, inertia;
  py::dict parameters;
};
struct ConstrainedMotion {
  py::array_t<double> acceleration, force, multiplier, residual;
  std::vector<std::string> rows;
  py::array_t<bool> active, redundant;
  py::object derivatives;
};

template <class V>
void write_twist(const Vec3<V>& a, const Vec3<V>& b, V* out) {
  const V* const parts[6] = {&a.x, &a.y, &a.z, &b.x, &b.y, &b.z};
  for (int k = 0; k < 6; ++k) out[k] = *parts[k];
}

/// Rows that the others imply: their Jacobian is in the span of those before them, rows with a
/// force first.
std::vector<bool> redundant_rows(const World& w, const std::vector<ConstraintRow<double>>& rows,
                                 const std::vector<double>& multiplier,
                                 const std::vector<bool>& active) {
  constexpr double kSpan = 1e-5;  // of the row's length; the solver's 1e-10 is of its square
  const auto n = static_cast<Eigen::Index>(rows.size());
  std::vector<bool> out(rows.size(), false);
  MatX<double> basis(6 * w.size(), n);
  Eigen::Index rank = 0;
  for (const bool with_force : {true, false})
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (!active[i] || (multiplier[i] != 0.0) != with_force) continue;
      VecX<double> J = VecX<double>::Zero(6 * w.size());
      for (std::size_t s = 0; s < rows[i].bodies.size(); ++s) {
        const int body = rows[i].bodies[s];
        if (body == kWorld ||
            w.bodies[static_cast<std::size_t>(body)].kind == BodyKind::kPrescribed)
          continue;
        double part[6];
        write_twist(rows[i].J[s].torque, rows[i].J[s].force, part);
        const bool turns = w.bodies[static_cast<std::size_t>(body)].kind == BodyKind::kRigid;
        for (int k = turns ? 0 : 3; k < 6; ++k) J[6 * body + k] += part[k];
      }
      const double length = J.norm();
      if (length > 0.0) J /= length;
      for (int twice = 0; twice < 2; ++twice)
        J -= basis.leftCols(rank) * (basis.leftCols(rank).transpose() * J);
      if (!(length > 0.0) || J.norm() < kSpan) {
        out[i] = true;
      } else {
        basis.col(rank++) = J.normalized();
      }
    }
  return out;
}

py::array_t<bool> booleans(const std::vector<bool>& x) {
  py::array_t<bool> out(static_cast<py::ssize_t>(x.size()));
  std::copy(x.begin(), x.end(), out.mutable_data());
  return out;
}

/// ∂V̇ by all unknowns, (6n, unknowns).
RowMatX<double> acceleration_jacobian(const World& w) {
  RowMatX<double> out;
  int unknowns = 1;
  for (int first = 0; first < unknowns; first += kJetWidth) {
    const Assembled<JetD> x = assemble<JetD>(w, first);
    if (first == 0) {
      unknowns = x.unknowns;
      out.resize(6 * w.size(), unknowns);
    }
    const ConstrainedAcceleration<JetD> found = accelerate(w, x);
    for (Eigen::Index b = 0; b < w.size(); ++b) {
      JetD a[6];
      const Twist<JetD>& Vd = found.Vd[static_cast<std::size_t>(b)];
      write_twist(Vd.angular, Vd.linear, a);
      for (int k = 0; k < 6; ++k)
        for (int d = 0; d < kJetWidth && first + d < unknowns; ++d)
          out(6 * b + k, first + d) = a[k].v[d];
    }
  }
  return out;
}

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
    for (const ParameterShape& p : c.shape().parameters) {
      const int count = p.size == 16 ? 6 : p.size;
      std::vector<Eigen::Index> which;
      for (int k = 0; k < count; ++k) which.push_back(next++);
      out.parameters[py::str(c.name + "." + p.name)] = columns(J, which, {n, 6, count});
    }
  return out;
}

RowMatX<double> six_in(const std::string& what, const py::object& x, long n) {
  return x.is_none() ? RowMatX<double>::Zero(n, 6).eval() : matrix_in(what, x, n, 6);
}

World world_in(const std::string& where, const std::vector<Body>& bodies,
               const std::vector<NamedConstraint>& constraints, const py::object& pose,
               const py::object& twist) {
  World w;
  w.bodies = bodies;
  w.constraints = constraints;
  const long n = w.size();
  std::map<std::string, int> seen;
  for (const NamedConstraint& c : constraints)
    if (++seen[c.name] > 1)
      throw Error(where + ": two constraints are called '" + c.name + "'; give each a name=");
  const py::array_t<double> H = number_array(where + ": pose", pose);
  if (H.ndim() != 3 || H.shape(0) != n || H.shape(1) != 4 || H.shape(2) != 4)
    throw ShapeError(where + ": pose: got shape " + shape_text(H) + ", expected (" +
                     std::to_string(n) + ", 4, 4), one a body");
  for (long b = 0; b < n; ++b)
    w.poses.push_back(pose_in(where + ": pose of body " + std::to_string(b), H.data() + 16 * b));
  w.twists = six_in(where + ": twist", twist, n);
  w.applied = w.prescribed = RowMatX<double>::Zero(n, 6);
  return w;
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
    x = assemble<double>(w, 0);
    found = naming_contradictions(w, [&](int without) {
      return accelerate(w, without < 0 ? x : assemble<double>(w, 0, without));
    });
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
      active.push_back(x.rows[i].relation == Relation::kEqual || found.multiplier[i] > 0.0);
    }
    redundant = redundant_rows(w, x.rows, found.multiplier, active);
    if (derivatives) J = acceleration_jacobian(w);
  }
  ConstrainedMotion out;
  out.acceleration = array_out(a);
  out.force = array_out(f);
  out.multiplier = array_out(lambda);
  out.residual = array_out(residual);
  for (const ConstraintRow<double>& row : x.rows) out.rows.push_back(row.name);
  out.active = booleans(active);
  out.redundant = booleans(redundant);
  out.derivatives = derivatives ? py::cast(split(w, J)) : py::none();
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
    const std::vector<Twist<double>> V = naming_contradictions(w, [&](int without) {
      const Assembled<double> x = assemble<double>(w, 0, without);
      return after_impact(x.bodies, x.states, x.rows, restitution);
    });
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
      "``name``: as errors and results name it, the kind's by default.");
  c.def(py::init([](const std::string& kind, const py::object& bodies, const std::string& name,
                    const py::kwargs& parameters) {
          return constraint_in(kind, bodies, name, parameters);
        }),
        "kind"_a, "bodies"_a, "name"_a = "")
      .def_property_readonly(
          "kind", [](const NamedConstraint& x) { return x.kind; }, "``rod``, ``string`` …")
      .def_property_readonly(
          "name", [](const NamedConstraint& x) { return x.name; }, "As errors name it.")
      .def_property_readonly(
          "bodies",
          [](const NamedConstraint& x) {
            py::tuple out(x.bodies.size());
            for (std::size_t b = 0; b < x.bodies.size(); ++b)
              out[b] = x.bodies[b] == kWorld ? py::object(py::none())
                                             : py::object(py::int_(x.bodies[b]));
            return out;
          },
          "Indices; None: the world.")
      .def_property_readonly(
          "parameters",
          [](const NamedConstraint& x) {
            py::dict out;
            for (std::size_t p = 0; p < x.parameters.size(); ++p) {
              const ParameterShape& shape = x.shape().parameters[p];
              out[shape.name] = parameter_out(shape, x.parameters[p]);
            }
            return out;
          },
          "By name: numbers and arrays.")
      .def("__repr__",
           [](const py::object& self) {
             return "Constraint(" + std::string(py::repr(self.attr("kind"))) + ", " +
                    std::string(py::repr(self.attr("bodies"))) +
                    ", name=" + std::string(py::repr(self.attr("name"))) + ")";
           })
      .def(py::pickle(
          [](const NamedConstraint& x) {
            return py::make_tuple(x.kind, x.name, x.bodies, x.parameters);
          },
          [](const py::tuple& t) {
            return NamedConstraint{t[0].cast<std::string>(), t[1].cast<std::string>(),
                                   t[2].cast<std::vector<int>>(),
                                   t[3].cast<std::vector<std::vector<double>>>()};
          }));
  c.attr("__module__") = "diffnea";
}

}  // namespace

void bind_constraints(py::module_& m) {
  bind_body(m);
  bind_constraint(m);
  using D = ConstrainedDerivatives;
  value_type<D>(
      m, "ConstrainedDerivatives",
      "Derivatives of constrained accelerations (n, 6), at the active set that holds.",
      field("pose", &D::pose, "(n, 6, n, 6) by ξ of X exp(ξ), in the moved body's frame."),
      field("twist", &D::twist, "(n, 6, n, 6) by the twists."),
      field("inertia", &D::inertia, "(n, 6, n, 10) by the bodies' inertial parameters."),
      field("parameters", &D::parameters,
            "By ``constraint.parameter``: (n, 6, k) for its k numbers; of a pose by ξ of X "
            "exp(ξ)."));
  using M = ConstrainedMotion;
  value_type<M>(
      m, "ConstrainedMotion", "Accelerations of n bodies, and what m rows of constraints do.",
      field("acceleration", &M::acceleration,
            "(n, 6) derivative of the twist in the body's frame, angular first [rad/s², m/s²]."),
      field("force", &M::force, "(n, 6) of all constraints, in the body's frame [N·m, N]."),
      field("multiplier", &M::multiplier, "(m,) λ of each row; 0 where it does nothing."),
      field("residual", &M::residual, "(m,) g of each row: 0 where it holds."),
      field("rows", &M::rows, "The constraint that each row belongs to, a list of m names."),
      field("active", &M::active,
            "(m,) booleans: equalities, and inequalities that hold something back."),
      field("redundant", &M::redundant,
            "(m,) booleans: active, but implied by the others; the motion is unique, these forces "
            "are not."),
      field("derivatives", &M::derivatives,
            "A :class:`ConstrainedDerivatives` if it was asked for, else None."));
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
