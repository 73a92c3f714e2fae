#pragma once

#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/model/free_base.hpp>

namespace diffnea {
namespace detail {

/// What the world adds to a link without a parent: V = 0 and A = a₀ = [0; −g].
template <Scalar P, Scalar R>
Twist<R> base_acceleration(const Tree<P>& tree) {
  return {{R(0.0), R(0.0), R(0.0)}, (-tree.gravity).template cast<R>()};
}
template <Scalar R>
Twist<R> zero_twist() {
  return {{R(0.0), R(0.0), R(0.0)}, {R(0.0), R(0.0), R(0.0)}};
}

/// The base's numbers at the head of a velocity, an acceleration or a torque.
///@{
template <class T>
Twist<T> base_twist(const T* v) {
  return {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}
template <class T>
void write_base(const Vec3<T>& angular, const Vec3<T>& linear, T* out) {
  out[0] = angular.x;
  out[1] = angular.y;
  out[2] = angular.z;
  out[3] = linear.x;
  out[4] = linear.y;
  out[5] = linear.z;
}
///@}

/// Numbers of the joints: behind those of a free base.
///@{
template <Scalar P, class T>
T* joints_in_positions(const Tree<P>& tree, T* q) {
  return q + (tree.free_base ? kBasePositions : 0);
}
template <Scalar P, class T>
T* joints_in_velocities(const Tree<P>& tree, T* v) {
  return v + (tree.free_base ? kBaseVelocities : 0);
}
///@}

/// Motion of a free base.
template <class R>
struct BaseMotion {
  Pose<R> X_WB;
  Twist<R> V, A;  ///< twist, and acceleration minus gravity, in B
};

/// From q, v and v̇, of whose joints nothing is read.
template <Scalar P, Scalar S, Scalar A>
BaseMotion<Prod<P, S>> base_motion(const Tree<P>& tree, const S* q, const S* v, const A* vd) {
  using R = Prod<P, S>;
  const Pose<S> X_WB = base_pose(q);
  const Twist<S> V = base_twist(v);
  const Twist<A> Vd = base_twist(vd);
  return {X_WB.template cast<R>(),
          {V.angular.template cast<R>(), V.linear.template cast<R>()},
          {Vd.angular.template cast<R>(), Vd.linear - transpose_times(X_WB.R, tree.gravity)}};
}

/// Sets pose, twist and acceleration of link 0, a free base.
template <Scalar P, Scalar S, Scalar A>
void move_base(const Tree<P>& tree, const S* q, const S* v, const A* vd, LinkStates<P, S>& ws) {
  ws.links.resize(tree.num_links());
  const BaseMotion<Prod<P, S>> base = base_motion(tree, q, v, vd);
  ws.links[0].X_PL = base.X_WB;
  ws.links[0].V = base.V;
  ws.links[0].A = base.A;
}

/// Paper, Algorithm 2, on plain arrays, one number a joint. A: scalar of the accelerations. A free
/// base has been moved (move_base); the wrench on it is left in its F.
template <class Floats, Scalar P, Scalar S, Scalar A>
void rnea_of_joints(Floats floats, const Tree<P>& tree, const S* q, const S* qd, const A* qdd,
                    LinkStates<P, S>& ws, Prod<P, S>* tau) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  const int first = floats ? 1 : 0;  // link that a joint moves
  ws.links.resize(n);
  const Twist<R> A0 = base_acceleration<P, R>(tree);

  if (floats) {
    const SpatialInertia<P>& own = tree.links[0].inertia;
    auto& l = ws.links[0];
    l.F = own * l.A + minus_ad_star(l.V, own * l.V);
  }
  for (int i = first; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    const int j = i - first;
    auto& l = ws.links[i];
    with_axis(link, [&](const auto& s) {
      l.X_PL = joint_pose(link, s, q[j]);
      const bool root = link.parent < 0;
      const Twist<R> V_P = root ? zero_twist<R>() : to_child(l.X_PL, ws.links[link.parent].V);
      const Twist<R> A_P = to_child(l.X_PL, root ? A0 : ws.links[link.parent].A);
      l.V = V_P + s * qd[j];                        // v̄ = Ad v̄_λ + s q̇
      l.A = A_P + ad(l.V, s) * qd[j] + s * qdd[j];  // ā = Ad ā_λ + ad_v s q̇ + s q̈
      l.F = link.inertia * l.A + minus_ad_star(l.V, link.inertia * l.V);  // f̄ = M̄ā − ad*_v M̄v̄
    });
  }
  for (int i = n - 1; i >= first; --i) {
    const Link<P>& link = tree.links[i];
    const int j = i - first;
    auto& l = ws.links[i];
    with_axis(link, [&](const auto& s) {
      tau[j] = dot(s, l.F) + qdd[j] * link.armature;
    });  // u = sᵀf̄ + I_r q̈
    if (link.parent >= 0) {
      auto& F_P = ws.links[link.parent].F;
      F_P = F_P + to_parent(l.X_PL, l.F);  // f̄_λ += Ad* f̄
    }
  }
}

/// The same of the coordinates, on arrays of tree.num_positions(), tree.num_velocities().
template <Scalar P, Scalar S>
void rnea(const Tree<P>& tree, const S* y, const S* yd, const S* ydd, LinkStates<P, S>& ws,
          Prod<P, S>* tau) {
  const Coordinates& c = tree.coordinates;
  with_base<Prod<P, S>>(tree, [&](auto floats) {
    const int at = floats ? kBasePositions : 0, at_v = floats ? kBaseVelocities : 0;
    if (floats) move_base(tree, y, yd, ydd, ws);
    rnea_of_joints(floats, tree, c.of_joints(y + at, true, ws.joints.q),
                   c.of_joints(yd + at_v, false, ws.joints.qd),
                   c.of_joints(ydd + at_v, false, ws.joints.qdd), ws,
                   ws.joints.torques(c, tau + at_v));
    if (!c.plain()) c.gather(ws.joints.tau.data(), tau + at_v);
    if (floats) write_base(ws.links[0].F.torque, ws.links[0].F.force, tau);
  });
}

/// X_PL alone, X_WB of a free base.
template <Scalar P, Scalar S>
void joint_poses(const Tree<P>& tree, const S* y, LinkStates<P, S>& ws) {
  const S* q = tree.coordinates.of_joints(joints_in_positions(tree, y), true, ws.joints.q);
  const int first = tree.first_joint();
  ws.links.resize(tree.num_links());
  if (tree.free_base) ws.links[0].X_PL = base_pose(y).template cast<Prod<P, S>>();
  for (int i = first; i < tree.num_links(); ++i)
    with_axis(tree.links[i], [&](const auto& s) {
      ws.links[i].X_PL = joint_pose(tree.links[i], s, q[i - first]);
    });
}

/// Algorithm 2 at rest, with the poses X_PL of `ws`: ā = Ad ā_λ has no angular part, f̄ = M̄ ā.
template <Scalar P, Scalar S>
void gravity_torques(const Tree<P>& tree, LinkStates<P, S>& ws, Prod<P, S>* out) {
  using R = Prod<P, S>;
  const int n = tree.num_links(), first = tree.first_joint();
  R* tau_y = joints_in_velocities(tree, out);
  R* tau = ws.joints.torques(tree.coordinates, tau_y);
  const Vec3<R> a0 = (-tree.gravity).template cast<R>();
  for (int i = 0; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    l.A.linear = transpose_times(l.X_PL.R, link.parent < 0 ? a0 : ws.links[link.parent].A.linear);
    l.F = {cross(link.inertia.h, l.A.linear), l.A.linear * link.inertia.m};
  }
  for (int i = n - 1; i >= first; --i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    with_axis(link, [&](const auto& s) { tau[i - first] = dot(s, l.F); });
    if (link.parent >= 0) {
      auto& F_P = ws.links[link.parent].F;
      F_P = F_P + to_parent(l.X_PL, l.F);
    }
  }
  if (!tree.coordinates.plain()) tree.coordinates.gather(tau, tau_y);
  if (tree.free_base) write_base(ws.links[0].F.torque, ws.links[0].F.force, out);
}

}  // namespace detail

template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& rnea(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd, VecIn<S> qdd,
                             RneaWorkspace<P, S>& ws) {
  require_positions("rnea: q", tree, q);
  require_velocities("rnea: qd", tree, qd);
  require_velocities("rnea: qdd", tree, qdd);
  ws.tau.resize(tree.num_velocities());
  call_inlined<Prod<P, S>>(
      [&] { detail::rnea(tree, q.data(), qd.data(), qdd.data(), ws, ws.tau.data()); });
  return ws.tau;
}

template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& gravity_torques(const Tree<P>& tree, VecIn<S> q, RneaWorkspace<P, S>& ws) {
  require_positions("gravity_torques: q", tree, q);
  ws.tau.resize(tree.num_velocities());
  detail::joint_poses(tree, q.data(), ws);
  detail::gravity_torques(tree, ws, ws.tau.data());
  return ws.tau;
}

#ifdef DIFFNEA_COMPILED
#define DIFFNEA_EXTERN(P, S)                                                                       \
  extern template const VecX<Prod<P, S>>& rnea<P, S>(const Tree<P>&, VecIn<S>, VecIn<S>, VecIn<S>, \
                                                     RneaWorkspace<P, S>&);                        \
  extern template const VecX<Prod<P, S>>& gravity_torques<P, S>(const Tree<P>&, VecIn<S>,          \
                                                                RneaWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_EXTERN)
#undef DIFFNEA_EXTERN
#endif

}  // namespace diffnea
