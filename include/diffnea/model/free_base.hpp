#pragma once
/// Positions of a tree whose base floats: the base's pose at the head of q, and steps on the
/// manifold of poses. Of a tree on a fixed base q is the joints' positions, and a step adds to
/// them.

#include <cmath>
#include <string>

#include <diffnea/core/error.hpp>
#include <diffnea/lie/se3.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea {

/// Largest |norm − 1| of a quaternion that counts as unit: one written with six digits is.
inline constexpr double kUnitQuaternionTol = 1e-5;

/// X_WB, from q = [x y z qx qy qz qw …]. Length and sign of the quaternion do not matter: its
/// derivatives are those on the unit sphere.
template <Scalar S>
Pose<S> base_pose(const S* q) {
  const S &x = q[3], &y = q[4], &z = q[5], &w = q[6];
  const S s = S(2.0) / (x * x + y * y + z * z + w * w), one(1.0);
  return {{{{one - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y)},
            {s * (x * y - w * z), one - s * (x * x + z * z), s * (y * z + w * x)},
            {s * (x * z + w * y), s * (y * z - w * x), one - s * (x * x + y * y)}}},
          {q[0], q[1], q[2]}};
}

/// @param x, y, z, w  of the base's quaternion  @throws DataError naming the norm unless it is unit
inline void require_unit_quaternion(const char* where, double x, double y, double z, double w) {
  const double norm = std::sqrt(x * x + y * y + z * z + w * w);
  if (std::abs(norm - 1.0) < kUnitQuaternionTol) return;
  throw DataError(std::string(where) + ": the base's quaternion qx qy qz qw, entries 3 to 6, is " +
                  std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + " " +
                  std::to_string(w) + ", of norm " + std::to_string(norm) + ", expected norm 1");
}

/// @throws ShapeError if q has not tree.num_positions() entries
/// @throws DataError if the quaternion of a free base is not unit (of packs nobody looks at it)
template <Scalar P, class Vector>
void require_positions(const char* where, const Tree<P>& tree, const Vector& q) {
  require_size(where, q.size(), tree.num_positions(),
               tree.free_base ? "number of the base's pose, of 7, and joint" : "joint");
  if constexpr (std::convertible_to<decltype(value(q[0])), double>)
    if (tree.free_base)
      require_unit_quaternion(where, value(q[3]), value(q[4]), value(q[5]), value(q[6]));
}
/// @throws ShapeError if v, an acceleration or a torque has not tree.num_velocities() entries
template <Scalar P, class Vector>
void require_velocities(const char* where, const Tree<P>& tree, const Vector& v) {
  require_size(where, v.size(), tree.num_velocities(),
               tree.free_base ? "number of the base's twist, of 6, and joint" : "joint");
}
/// @throws ModelError, naming what takes no tree on a free base
template <Scalar P>
void require_fixed_base(const char* where, const Tree<P>& tree) {
  if (tree.free_base)
    throw ModelError(std::string(where) + ": the tree's base floats, expected a fixed one");
}

/// q ⊕ v: X_WB exp(V) of the base, q + v of the joints. A step of h seconds is v h, a perturbation
/// of a derivative is v itself.
/// @param q  (7 + n), of a fixed base (n)  @param v  (6 + n), of a fixed base (n)
/// @return of q's length, the quaternion with norm 1
/// @throws ShapeError, DataError as require_positions
template <Scalar P, Scalar S>
VecX<S> integrate(const Tree<P>& tree, const VecX<S>& q, const VecX<S>& v) {
  using std::sqrt;
  require_positions("integrate: q", tree, q);
  require_velocities("integrate: v", tree, v);
  const int n = tree.num_dofs();
  VecX<S> out = q;
  out.tail(n) += v.tail(n);
  if (!tree.free_base) return out;
  const Twist<S> V{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
  out.template head<3>() = to_eigen((base_pose(q.data()) * exp(V)).p);
  // Quaternion product with [a ω/2; c], a = sin(θ/2)/(θ/2), c = cos(θ/2): smooth at θ = 0.
  const S quarter = dot(V.angular, V.angular) * S(0.25);
  const S c = S(1.0) - quarter * versine_over_square(quarter);
  const Vec3<S> u = V.angular * (sine_over_angle(quarter) * S(0.5)), p{q[3], q[4], q[5]};
  const Vec3<S> xyz = p * c + u * q[6] + cross(p, u);
  const S w = q[6] * c - dot(p, u), scale = S(1.0) / sqrt(dot(xyz, xyz) + w * w);
  out.template segment<3>(3) = to_eigen(Vec3<S>(xyz * scale));
  out[6] = w * scale;
  return out;
}

/// The v with from ⊕ v = to, |ω| ≤ π: of a free base log(X⁻¹ X'), of joints the difference.
/// @param from, to  (7 + n), of a fixed base (n); double or Jet
/// @return (6 + n), of a fixed base (n)
/// @throws ShapeError, DataError as require_positions
template <Scalar P, Scalar S>
VecX<S> difference(const Tree<P>& tree, const VecX<S>& from, const VecX<S>& to) {
  require_positions("difference: from", tree, from);
  require_positions("difference: to", tree, to);
  const int n = tree.num_dofs();
  VecX<S> out(tree.num_velocities());
  out.tail(n) = to.tail(n) - from.tail(n);
  if (!tree.free_base) return out;
  const Twist<S> V = log(inverse(base_pose(from.data())) * base_pose(to.data()));
  out.template head<3>() = to_eigen(V.angular);
  out.template segment<3>(3) = to_eigen(V.linear);
  return out;
}

}  // namespace diffnea
