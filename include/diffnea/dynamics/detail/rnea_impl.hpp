#pragma once

#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/dynamics/rnea.hpp>

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

/// Paper, Algorithm 2, on plain arrays, one number a joint. A: scalar of the accelerations.
template <Scalar P, Scalar S, Scalar A>
void rnea_of_joints(const Tree<P>& tree, const S* q, const S* qd, const A* qdd,
                    LinkStates<P, S>& ws, Prod<P, S>* tau) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  ws.links.resize(n);
  const Twist<R> A0 = base_acceleration<P, R>(tree);

  for (int i = 0; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    with_axis(link, [&](const auto& s) {
      l.X_PL = joint_pose(link, s, q[i]);
      const bool root = link.parent < 0;
      const Twist<R> V_P = root ? zero_twist<R>() : to_child(l.X_PL, ws.links[link.parent].V);
      const Twist<R> A_P = to_child(l.X_PL, root ? A0 : ws.links[link.parent].A);
      l.V = V_P + s * qd[i];                        // v̄ = Ad v̄_λ + s q̇
      l.A = A_P + ad(l.V, s) * qd[i] + s * qdd[i];  // ā = Ad ā_λ + ad_v s q̇ + s q̈
      l.F = link.inertia * l.A + minus_ad_star(l.V, link.inertia * l.V);  // f̄ = M̄ā − ad*_v M̄v̄
    });
  }
  for (int i = n - 1; i >= 0; --i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    with_axis(link, [&](const auto& s) {
      tau[i] = dot(s, l.F) + qdd[i] * link.armature;
    });  // u = sᵀf̄ + I_r q̈
    if (link.parent >= 0) {
      auto& F_P = ws.links[link.parent].F;
      F_P = F_P + to_parent(l.X_PL, l.F);  // f̄_λ += Ad* f̄
    }
  }
}

/// The same of the coordinates, on arrays of length n.
template <Scalar P, Scalar S>
void rnea(const Tree<P>& tree, const S* y, const S* yd, const S* ydd, LinkStates<P, S>& ws,
          Prod<P, S>* tau) {
  const Coordinates& c = tree.coordinates;
  rnea_of_joints(tree, c.of_joints(y, true, ws.joints.q), c.of_joints(yd, false, ws.joints.qd),
                 c.of_joints(ydd, false, ws.joints.qdd), ws, ws.joints.torques(c, tau));
  if (!c.plain()) c.gather(ws.joints.tau.data(), tau);
}

/// X_PL alone.
template <Scalar P, Scalar S>
void joint_poses(const Tree<P>& tree, const S* y, LinkStates<P, S>& ws) {
  const S* q = tree.coordinates.of_joints(y, true, ws.joints.q);
  ws.links.resize(tree.num_links());
  for (int i = 0; i < tree.num_links(); ++i)
    with_axis(tree.links[i],
              [&](const auto& s) { ws.links[i].X_PL = joint_pose(tree.links[i], s, q[i]); });
}

/// Algorithm 2 at rest, with the poses X_PL of `ws`: ā = Ad ā_λ has no angular part, f̄ = M̄ ā.
template <Scalar P, Scalar S>
void gravity_torques(const Tree<P>& tree, LinkStates<P, S>& ws, Prod<P, S>* tau_y) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  R* tau = ws.joints.torques(tree.coordinates, tau_y);
  const Vec3<R> a0 = (-tree.gravity).template cast<R>();
  for (int i = 0; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    l.A.linear = transpose_times(l.X_PL.R, link.parent < 0 ? a0 : ws.links[link.parent].A.linear);
    l.F = {cross(link.inertia.h, l.A.linear), l.A.linear * link.inertia.m};
  }
  for (int i = n - 1; i >= 0; --i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    with_axis(link, [&](const auto& s) { tau[i] = dot(s, l.F); });
    if (link.parent >= 0) {
      auto& F_P = ws.links[link.parent].F;
      F_P = F_P + to_parent(l.X_PL, l.F);
    }
  }
  if (!tree.coordinates.plain()) tree.coordinates.gather(tau, tau_y);
}

}  // namespace detail

template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& rnea(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd, VecIn<S> qdd,
                             RneaWorkspace<P, S>& ws) {
  const int n = tree.num_dofs();
  require_size("rnea: q", q.size(), n, "joint");
  require_size("rnea: qd", qd.size(), n, "joint");
  require_size("rnea: qdd", qdd.size(), n, "joint");
  ws.tau.resize(n);
  call_inlined<Prod<P, S>>(
      [&] { detail::rnea(tree, q.data(), qd.data(), qdd.data(), ws, ws.tau.data()); });
  return ws.tau;
}

template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& gravity_torques(const Tree<P>& tree, VecIn<S> q, RneaWorkspace<P, S>& ws) {
  const int n = tree.num_dofs();
  require_size("gravity_torques: q", q.size(), n, "joint");
  ws.tau.resize(n);
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
