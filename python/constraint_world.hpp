#pragma once
/// Bodies and constraints as Python holds them, and the world that they make in any scalar.

#include <map>
#include <string>
#include <vector>

#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/constraints.hpp>

#include "arrays.hpp"

namespace diffnea::python {

struct Body {
  BodyKind kind = BodyKind::kRigid;
  VecX<double> theta = VecX<double>::Zero(kThetaSize);
};

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

/// By the name of their kind.
const std::map<std::string, ConstraintShape>& constraint_kinds();

struct NamedConstraint {
  std::string kind, name;
  std::vector<int> bodies;                      ///< kWorld for the world
  std::vector<std::vector<double>> parameters;  ///< in the order of the kind's

  const ConstraintShape& shape() const { return constraint_kinds().at(kind); }
};

/// @throws Error, ShapeError, ModelError naming the constraint and what was expected
NamedConstraint constraint_in(const std::string& kind, const py::object& bodies,
                              const std::string& name, const py::kwargs& given);

struct World {
  std::vector<Body> bodies;
  std::vector<NamedConstraint> constraints;
  std::vector<Pose<double>> poses;
  RowMatX<double> twists, applied, prescribed;  ///< (n, 6)
  Vec3<double> gravity{0, 0, 0};
  Stabilisation stabilisation;

  long size() const { return static_cast<long>(bodies.size()); }
};

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
