#include "constraint_world.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include <diffnea/core/error.hpp>

namespace diffnea::python {
namespace {

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
};

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
  for (const NamedConstraint& c : w.constraints) append(c, seed, out.states, out.rows);
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
