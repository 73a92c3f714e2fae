#pragma once
/// Bodies and constraints as Python holds them, and the world that they make in any scalar.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/constraints.hpp>

#include "arrays.hpp"
#include "expression.hpp"

namespace diffnea::python {

struct Body {
  BodyKind kind = BodyKind::kRigid;
  VecX<double> theta = VecX<double>::Zero(kThetaSize);
};

/// Name and size of a parameter: a number, an array, or a pose if it is (4, 4).
struct ParameterShape {
  std::string name;
  std::vector<py::ssize_t> shape;  ///< NumPy's; empty: a number
  bool unit = false;               ///< a vector of length 1
  bool positive = false;

  std::size_t size() const;  ///< number of its entries
  bool is_pose() const { return shape == std::vector<py::ssize_t>{4, 4}; }
  /// Numbers that derivatives are taken of: of a pose those of ξ in X exp(ξ), angular first.
  std::size_t unknowns() const { return is_pose() ? 6 : size(); }
};
struct ConstraintKind {
  std::size_t bodies;
  std::vector<ParameterShape> parameters;
};

/// By the name of their kind.
const std::map<std::string, ConstraintKind>& constraint_kinds();

/// A constraint that was written in Python: g of the inputs that diffnea/_trace.py lists.
struct TracedFunction {
  Expression g;
  bool of_velocity = false;
  Relation relation = Relation::kEqual;
};

struct NamedConstraint {
  std::string kind, name;
  std::vector<int> bodies;                         ///< kWorld for the world
  std::vector<ParameterShape> shapes;              ///< one a parameter
  std::vector<std::vector<double>> parameters;     ///< a pose's are 16, in C order
  std::shared_ptr<const TracedFunction> function;  ///< null: one of constraint_kinds()
};

/// @param kind  the name of a kind, or a Python function
/// @throws Error, ShapeError, ModelError naming the constraint and what was expected
NamedConstraint constraint_in(const py::object& kind, const py::object& bodies,
                              const std::string& name, const std::string& relation,
                              const py::kwargs& given);

/// Indices; None: the world.
py::tuple bodies_out(const std::vector<int>& bodies);

/// Rows of a constraint at a state. @param parameters  as its own, in this scalar
template <class T>
void append(const NamedConstraint& c, const std::vector<std::vector<T>>& parameters,
            const std::vector<BodyState<T>>& states, std::vector<ConstraintRow<T>>& rows);
extern template void append(const NamedConstraint&, const std::vector<std::vector<double>>&,
                            const std::vector<BodyState<double>>&,
                            std::vector<ConstraintRow<double>>&);
extern template void append(const NamedConstraint&, const std::vector<std::vector<JetD>>&,
                            const std::vector<BodyState<JetD>>&, std::vector<ConstraintRow<JetD>>&);

/// A pose from its 16 numbers in C order, and the numbers from it.
///@{
template <class T>
Pose<T> pose_of(const std::vector<T>& H) {
  const auto column = [&H](std::size_t j) { return Vec3<T>{H[j], H[4 + j], H[8 + j]}; };
  return {{{column(0), column(1), column(2)}}, column(3)};
}
template <class T>
std::vector<T> numbers_of(const Pose<T>& X) {
  const Vec3<T>&a = X.R.col[0], &b = X.R.col[1], &c = X.R.col[2];
  const T o(0.0);
  return {a.x, b.x, c.x, X.p.x, a.y, b.y, c.y, X.p.y, a.z, b.z, c.z, X.p.z, o, o, o, T(1.0)};
}
///@}

struct World {
  std::vector<Body> bodies;
  std::vector<NamedConstraint> constraints;
  std::vector<Pose<double>> poses;
  RowMatX<double> twists, applied, prescribed;  ///< (n, 6)
  Vec3<double> gravity{0, 0, 0};
  Stabilisation stabilisation;

  long size() const { return static_cast<long>(bodies.size()); }
};

/// A pose's 16 numbers, checked. @throws ModelError if its rotation is none
Pose<double> pose_in(const std::string& what, const double* H);

/// No two constraints have one name. @param where  the function, for messages  @throws Error
void require_distinct(const std::string& where, const std::vector<NamedConstraint>& constraints);

/// (n, 6), zero where `x` is None. @throws ShapeError
RowMatX<double> six_in(const std::string& what, const py::object& x, long n);

/// Nothing applied or prescribed, no gravity.
/// @param where  the function, for messages  @throws Error, ShapeError, ModelError
World world_in(const std::string& where, const std::vector<Body>& bodies,
               const std::vector<NamedConstraint>& constraints, const py::object& pose,
               const py::object& twist);

/// Bodies, states and rows of a world.
template <class T>
struct Assembled {
  std::vector<FreeBody<T>> bodies;
  std::vector<BodyState<T>> states;
  std::vector<ConstraintRow<T>> rows;
  int unknowns = 0;  ///< that derivatives are taken of
};

Assembled<double> assemble(const World& w);
ConstrainedAcceleration<double> accelerate(const World& w, const Assembled<double>& x);

inline constexpr int kPerBody = 6 + 6 + kThetaSize;  ///< unknowns: pose, twist, inertia
/// ∂V̇ by all unknowns, (6n, unknowns): kPerBody of each body, then the constraints' parameters.
RowMatX<double> acceleration_jacobian(const World& w);

/// Six numbers, a first.
template <class V>
void write_twist(const Vec3<V>& a, const Vec3<V>& b, V* out) {
  const V* const parts[6] = {&a.x, &a.y, &a.z, &b.x, &b.y, &b.z};
  for (int k = 0; k < 6; ++k) out[k] = *parts[k];
}

}  // namespace diffnea::python
