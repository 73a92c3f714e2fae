#include "constraint_world.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>

#include "bindings.hpp"

namespace diffnea::python {
namespace {

std::vector<int> bodies_in(const std::string& what, const py::object& given) {
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
  return out;
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
    const Vec3<T> w = vector(kNone), v = vector(kNone);  // in this order
    return X.cast<T>() * exp(Twist<T>{w, v});
  }
  std::vector<std::vector<T>> parameters(const NamedConstraint& c) {
    std::vector<std::vector<T>> out;
    for (std::size_t i = 0; i < c.shapes.size(); ++i) {
      out.emplace_back();
      if (c.shapes[i].is_pose())
        out.back() = numbers_of(pose(pose_of(c.parameters[i])));
      else
        for (const double x : c.parameters[i]) out.back().push_back((*this)(x));
    }
    return out;
  }
};

/// A traced function as append_rows takes it, of N bodies that are not the world.
template <class P, int N, bool kOfVelocity>
struct Traced {
  static constexpr int kBodies = N;
  static constexpr Relation kRelation = Relation::kEqual;
  const Expression& g;
  std::vector<const P*> parameters;  ///< their numbers, of a pose the first twelve

  template <class T>
  std::vector<T> at(const std::array<Pose<T>, N>& X, const std::array<Twist<T>, N>* V) const {
    constexpr int kPoses = 12 * N, kTwists = kOfVelocity ? 6 * N : 0;
    return g.operator()<T>([&](int k) -> T {
      if (k >= kPoses + kTwists)
        return T(*parameters[static_cast<std::size_t>(k - kPoses - kTwists)]);
      if (k >= kPoses) {
        const Twist<T>& of = (*V)[static_cast<std::size_t>((k - kPoses) / 6)];
        return entry((k - kPoses) % 6 < 3 ? of.angular : of.linear, (k - kPoses) % 3);
      }
      const Pose<T>& of = X[static_cast<std::size_t>(k / 12)];
      return entry(k % 4 < 3 ? of.R.col[k % 4] : of.p, k % 12 / 4);
    });
  }
  template <class T>
  static const T& entry(const Vec3<T>& v, int k) {
    return k == 0 ? v.x : k == 1 ? v.y : v.z;
  }
  template <class T>
    requires(!kOfVelocity)
  std::vector<T> operator()(const std::array<Pose<T>, N>& X) const {
    return at<T>(X, nullptr);
  }
  template <class T>
    requires kOfVelocity
  std::vector<T> operator()(const std::array<Pose<T>, N>& X,
                            const std::array<Twist<T>, N>& V) const {
    return at(X, &V);
  }
};

template <int N, bool kOfVelocity, class T>
void append_traced(const NamedConstraint& c, const std::vector<std::vector<T>>& parameters,
                   const std::vector<BodyState<T>>& states, std::vector<ConstraintRow<T>>& rows) {
  Traced<T, N, kOfVelocity> g{c.function->g, {}};
  for (std::size_t i = 0; i < parameters.size(); ++i)
    for (std::size_t k = 0; k < (c.shapes[i].is_pose() ? 12 : parameters[i].size()); ++k)
      g.parameters.push_back(&parameters[i][k]);
  std::array<int, N> bodies;
  std::ranges::copy_if(c.bodies, bodies.begin(), [](int b) { return b != kWorld; });
  const std::size_t first = rows.size();
  append_rows(g, c.name, bodies, states, rows);
  for (std::size_t i = first; i < rows.size(); ++i) rows[i].relation = c.function->relation;
}

template <class T>
Twist<T> twist_of(const double* x) {
  return {{T(x[0]), T(x[1]), T(x[2])}, {T(x[3]), T(x[4]), T(x[5])}};
}

/// @param first  unknown that the first variable of the sweep is
template <class T>
Assembled<T> assemble(const World& w, int first) {
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
  for (const NamedConstraint& c : w.constraints)
    append(c, seed.parameters(c), out.states, out.rows);
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

}  // namespace

Pose<double> pose_in(const std::string& what, const double* H) {
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(H);
  const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
  if (!((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-6) || R.determinant() < 0.0)
    throw ModelError(what + ": its rotation is none (R^T R = 1, det R = 1 expected)");
  return {mat3<double>(R), vec3<double>(Eigen::Vector3d(X.topRightCorner<3, 1>()))};
}

std::size_t ParameterShape::size() const {
  std::size_t out = 1;
  for (const py::ssize_t n : shape) out *= static_cast<std::size_t>(n);
  return out;
}

const std::map<std::string, ConstraintKind>& constraint_kinds() {
  static const std::map<std::string, ConstraintKind> kKinds = [] {
    const auto vector = [](const char* name) { return ParameterShape{name, {3}}; };
    const auto direction = [](const char* name) { return ParameterShape{name, {3}, true}; };
    const auto pose = [](const char* name) { return ParameterShape{name, {4, 4}}; };
    const auto size = [](const char* name) { return ParameterShape{name, {}, false, true}; };
    const ConstraintKind rod{2, {vector("p_AP"), vector("p_BQ"), size("length")}},
        wheel{1, {vector("p_BC"), direction("axle_B"), size("radius")}};
    return std::map<std::string, ConstraintKind>{
        {"rod", rod},
        {"string", rod},
        {"ball_joint", {2, {vector("p_AP"), vector("p_BQ")}}},
        {"hinge", {2, {pose("X_AJ"), pose("X_BK")}}},
        {"wheel_contact", wheel},
        {"rolling_wheel", wheel},
        {"skate", {1, {vector("p_BP"), direction("across_B")}}}};
  }();
  return kKinds;
}

template <class T>
void append(const NamedConstraint& c, const std::vector<std::vector<T>>& parameters,
            const std::vector<BodyState<T>>& states, std::vector<ConstraintRow<T>>& rows) {
  if (c.function) {
    const bool two = std::ranges::count(c.bodies, kWorld) + 2 == std::ssize(c.bodies);
    if (c.function->of_velocity)
      return two ? append_traced<2, true>(c, parameters, states, rows)
                 : append_traced<1, true>(c, parameters, states, rows);
    return two ? append_traced<2, false>(c, parameters, states, rows)
               : append_traced<1, false>(c, parameters, states, rows);
  }
  const auto vector = [&](std::size_t i) {
    return Vec3<T>{parameters[i][0], parameters[i][1], parameters[i][2]};
  };
  const auto two = [&](const auto& constraint) {
    append_rows(constraint, c.name, {c.bodies[0], c.bodies[1]}, states, rows);
  };
  const auto one = [&](const auto& constraint) {
    append_rows(constraint, c.name, {c.bodies[0]}, states, rows);
  };
  if (c.kind == "hinge") return two(Hinge<T>{pose_of(parameters[0]), pose_of(parameters[1])});
  const Vec3<T> a = vector(0), b = vector(1);
  if (c.kind == "ball_joint") return two(BallJoint<T>{a, b});
  if (c.kind == "skate") return one(Skate<T>{a, b});
  const T& length = parameters[2][0];
  if (c.kind == "rod") return two(Rod<T>{a, b, length});
  if (c.kind == "string") return two(String<T>{{a, b, length}});
  if (c.kind == "wheel_contact") return one(WheelContact<T>{a, b, length});
  return one(RollingWheel<T>{a, b, length});
}
template void append(const NamedConstraint&, const std::vector<std::vector<double>>&,
                     const std::vector<BodyState<double>>&, std::vector<ConstraintRow<double>>&);
template void append(const NamedConstraint&, const std::vector<std::vector<JetD>>&,
                     const std::vector<BodyState<JetD>>&, std::vector<ConstraintRow<JetD>>&);

namespace {

/// The numbers of a parameter. @param where  its name, for messages
std::vector<double> parameter_in(const std::string& where, const ParameterShape& shape,
                                 const py::object& value) {
  if (shape.is_pose()) {
    const RowMatX<double> H = matrix_in(where, value, 4, 4);
    pose_in(where, H.data());
    return {H.data(), H.data() + 16};
  }
  const py::array_t<double> array = number_array(where, value);
  const std::vector<py::ssize_t> got(array.shape(), array.shape() + array.ndim());
  if (got != shape.shape)
    throw ShapeError(where + ": got shape " + shape_text(array) + ", expected " +
                     std::string(py::str(py::tuple(py::cast(shape.shape)))));
  std::vector<double> out(array.data(), array.data() + array.size());
  double square = 0.0;
  for (const double x : out) square += x * x;
  if (shape.positive && !(out[0] > 0.0))
    throw ModelError(where + ": got " + std::to_string(out[0]) + " m, expected more than 0");
  if (shape.unit && !(std::abs(std::sqrt(square) - 1.0) < 1e-6))
    throw ModelError(where + ": got a vector of length " + std::to_string(std::sqrt(square)) +
                     ", expected a unit vector");
  if (!std::isfinite(square)) throw ModelError(where + ": expected finite numbers");
  return out;
}

NamedConstraint kind_in(const std::string& kind, const py::object& bodies, const std::string& name,
                        const std::string& relation, const py::kwargs& given) {
  const auto found = constraint_kinds().find(kind);
  std::string choices;
  for (const auto& [known, its] : constraint_kinds())
    choices += (choices.empty() ? "" : ", ") + known;
  if (found == constraint_kinds().end())
    throw Error("Constraint: kind: got '" + kind + "'; choices: " + choices +
                ", or a function of poses");
  const std::vector<ParameterShape>& shapes = found->second.parameters;
  NamedConstraint out{kind, name.empty() ? kind : name, {}, shapes, {}, nullptr};
  const std::string what = "Constraint '" + out.name + "' (" + kind + ")";
  if (relation != "equal")
    throw Error(what + ": relation: got '" + relation +
                "', which a function alone takes; a rod that is an upper bound is a string");
  out.bodies = bodies_in(what, bodies);
  if (out.bodies.size() != found->second.bodies)
    throw ShapeError(what + ": bodies: got " + std::to_string(out.bodies.size()) + ", expected " +
                     std::to_string(found->second.bodies));
  std::string names;
  for (const ParameterShape& p : shapes) names += (names.empty() ? "" : ", ") + p.name;
  for (const auto& [key, value] : given)
    if (std::ranges::find(shapes, key.cast<std::string>(), &ParameterShape::name) == shapes.end())
      throw Error(what + ": got parameter '" + key.cast<std::string>() + "'; parameters: " + names);
  for (const ParameterShape& p : shapes) {
    const std::string where = what + ": " + p.name;
    if (!given.contains(p.name)) throw Error(where + " is missing; parameters: " + names);
    out.parameters.push_back(parameter_in(where, p, given[p.name.c_str()]));
  }
  return out;
}

NamedConstraint function_in(const py::object& function, const py::object& bodies,
                            const std::string& name, const std::string& relation,
                            const py::kwargs& given) {
  NamedConstraint out;
  out.kind = py::getattr(function, "__name__", py::str("function")).cast<std::string>();
  out.name = name.empty() ? out.kind : name;
  const std::string what = "Constraint '" + out.name + "'";
  auto g = std::make_shared<TracedFunction>();
  if (relation == "at_most")
    g->relation = Relation::kAtMost;
  else if (relation != "equal")
    throw Error(what + ": relation: got '" + relation + "'; choices: equal, at_most");
  out.bodies = bodies_in(what, bodies);
  const auto moving = std::ssize(out.bodies) - std::ranges::count(out.bodies, kWorld);
  if (moving < 1 || moving > kMostBodies)
    throw ShapeError(what + ": bodies: got " + std::to_string(moving) +
                     " besides the world, expected 1 or " + std::to_string(kMostBodies));
  const py::tuple traced =
      python_function("diffnea._trace", "trace")(what, function, bodies_out(out.bodies), given);
  for (const py::handle step : traced[0]) {
    const py::tuple parts = step.cast<py::tuple>();
    Step s{operation_of(parts[0].cast<std::string>()), -1, parts[2].cast<int>(), 0.0};
    if (s.operation == Operation::kConstant)
      s.constant = parts[1].cast<double>();
    else
      s.a = parts[1].cast<int>();
    g->g.steps.push_back(s);
  }
  g->g.results = traced[1].cast<std::vector<int>>();
  g->of_velocity = traced[2].cast<bool>();
  for (const auto& [key, value] : traced[3].cast<py::dict>()) {
    const py::array array = value.cast<py::array>();
    const ParameterShape shape{key.cast<std::string>(),
                               {array.shape(), array.shape() + array.ndim()}};
    out.parameters.push_back(parameter_in(what + ": " + shape.name, shape, array));
    out.shapes.push_back(shape);
  }
  out.function = std::move(g);
  return out;
}

}  // namespace

py::tuple bodies_out(const std::vector<int>& bodies) {
  py::tuple out(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b)
    out[b] = bodies[b] == kWorld ? py::object(py::none()) : py::object(py::int_(bodies[b]));
  return out;
}

NamedConstraint constraint_in(const py::object& kind, const py::object& bodies,
                              const std::string& name, const std::string& relation,
                              const py::kwargs& given) {
  return py::isinstance<py::str>(kind)
             ? kind_in(kind.cast<std::string>(), bodies, name, relation, given)
             : function_in(kind, bodies, name, relation, given);
}

void require_distinct(const std::string& where, const std::vector<NamedConstraint>& constraints) {
  std::map<std::string, int> seen;
  for (const NamedConstraint& c : constraints)
    if (++seen[c.name] > 1)
      throw Error(where + ": two constraints are called '" + c.name + "'; give each a name=");
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
  require_distinct(where, constraints);
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

Assembled<double> assemble(const World& w) { return assemble<double>(w, 0); }

ConstrainedAcceleration<double> accelerate(const World& w, const Assembled<double>& x) {
  return accelerate<double>(w, x);
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

}  // namespace diffnea::python
