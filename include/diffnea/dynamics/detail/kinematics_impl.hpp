#pragma once

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/kinematics.hpp>

namespace diffnea {

template <Scalar P, Scalar S>
void forward_kinematics(const Tree<P>& tree, VecIn<S> y, VecIn<S> yd, VecIn<S> ydd,
                        LinkKinematics<Prod<P, S>>& out) {
  using R = Prod<P, S>;
  require_positions("forward_kinematics: q", tree, y);
  require_velocities("forward_kinematics: qd", tree, yd);
  require_velocities("forward_kinematics: qdd", tree, ydd);
  JointScratch<S, S> joints;
  const Coordinates& c = tree.coordinates;
  const S* q = c.of_joints(detail::joints_in_positions(tree, y.data()), true, joints.q);
  const S* qd = c.of_joints(detail::joints_in_velocities(tree, yd.data()), false, joints.qd);
  const S* qdd = c.of_joints(detail::joints_in_velocities(tree, ydd.data()), false, joints.qdd);
  out.links.resize(tree.num_links());
  if (tree.free_base) {
    auto& l = out.links[0];
    l.X_WL = base_pose(y.data()).template cast<R>();
    l.V = detail::zero_twist<R>() + detail::base_twist(yd.data());
    l.A = detail::zero_twist<R>() + detail::base_twist(ydd.data());
  }
  const int first = tree.first_joint();
  for (int i = first; i < tree.num_links(); ++i) {
    const Link<P>& link = tree.links[i];
    const int j = i - first;
    auto& l = out.links[i];
    const Twist<double> s = joint_twist(link);
    const Pose<R> X_PL = joint_pose(link, q[j]);
    if (link.parent < 0) {
      l.X_WL = X_PL;
      l.V = detail::zero_twist<R>() + s * qd[j];
      l.A = detail::zero_twist<R>() + s * qdd[j];
    } else {
      const auto& p = out.links[link.parent];
      l.X_WL = p.X_WL * X_PL;
      l.V = to_child(X_PL, p.V) + s * qd[j];
      l.A = to_child(X_PL, p.A) + ad(l.V, s) * qd[j] + s * qdd[j];
    }
  }
}

template <Scalar P, Scalar S>
void forward_kinematics(const Tree<P>& tree, VecIn<S> y, LinkKinematics<Prod<P, S>>& out) {
  require_positions("forward_kinematics: q", tree, y);
  std::vector<S> joints;
  const S* q =
      tree.coordinates.of_joints(detail::joints_in_positions(tree, y.data()), true, joints);
  out.links.resize(tree.num_links());
  if (tree.free_base) out.links[0].X_WL = base_pose(y.data()).template cast<Prod<P, S>>();
  const int first = tree.first_joint();
  for (int i = first; i < tree.num_links(); ++i) {
    const Link<P>& link = tree.links[i];
    const Pose<Prod<P, S>> X_PL = joint_pose(link, S(q[i - first]));
    out.links[i].X_WL = link.parent < 0 ? X_PL : out.links[link.parent].X_WL * X_PL;
  }
}

template <Scalar P, Scalar S>
void forward_kinematics(const Tree<P>& tree, const LinkStates<P, S>& states,
                        LinkKinematics<Prod<P, S>>& out) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  require_size("forward_kinematics: states", static_cast<long>(states.links.size()), n, "link");
  out.links.resize(n);
  for (int i = 0; i < n; ++i) {
    const auto& state = states.links[i];
    auto& l = out.links[i];
    const int parent = tree.links[i].parent;
    l.X_WL = parent < 0 ? state.X_PL : out.links[parent].X_WL * state.X_PL;
    l.V = state.V;
    // The world accelerated by a₀ = [0; −g]; a constant linear acceleration is the same everywhere.
    const Vec3<R> g_L = transpose_times(l.X_WL.R, tree.gravity);
    l.A = {state.A.angular, state.A.linear + g_L};
  }
}

template <Scalar T, Scalar F>
Pose<Prod<T, F>> frame_pose(const LinkKinematics<T>& kinematics, int link, const Pose<F>& X_LF) {
  if (link < 0) return X_LF.template cast<Prod<T, F>>();
  return kinematics.links[link].X_WL * X_LF;
}

template <Scalar T, Scalar F>
FrameMotion<Prod<T, F>> frame_motion(const LinkKinematics<T>& kinematics, int link,
                                     const Pose<F>& X_LF) {
  using R = Prod<T, F>;
  FrameMotion<R> out;
  out.X_WF = frame_pose(kinematics, link, X_LF);
  if (link < 0) {
    const Vec3<R> zero{R(0.0), R(0.0), R(0.0)};
    out.angular_velocity = out.velocity = out.angular_acceleration = out.acceleration = zero;
    return out;
  }
  const auto& l = kinematics.links[link];
  const Vec3<T>& w = l.V.angular;
  const Vec3<R> v = l.V.linear + cross(w, X_LF.p);            // ẋ_F = v + ω×p, in L
  const Vec3<R> a = l.A.linear + cross(l.A.angular, X_LF.p);  // spatial acceleration at F's origin
  out.angular_velocity = (l.X_WL.R * w).template cast<R>();
  out.velocity = l.X_WL.R * v;
  out.angular_acceleration = (l.X_WL.R * l.A.angular).template cast<R>();
  out.acceleration = l.X_WL.R * (a + cross(w, v));
  return out;
}

template <Scalar P, Scalar T, Scalar F>
void frame_jacobian(const Tree<P>& tree, const LinkKinematics<T>& kinematics, int link,
                    const Pose<F>& X_LF, MatX<Prod<T, F>>& J) {
  using R = Prod<T, F>;
  const Vec3<R> p_WF = frame_pose(kinematics, link, X_LF).p;
  J.setConstant(6, tree.num_velocities(), R(0.0));
  const int first = tree.first_joint(), base = tree.num_velocities() - tree.num_dofs();
  for (int i = link; i >= first; i = tree.links[i].parent) {
    const Pose<T>& X_WL = kinematics.links[i].X_WL;
    const Twist<double> s = joint_twist(tree.links[i]);
    const Vec3<T> w = X_WL.R * s.angular;
    const Vec3<R> v = X_WL.R * s.linear + cross(w, p_WF - X_WL.p);
    const R column[6] = {R(w.x), R(w.y), R(w.z), v.x, v.y, v.z};
    const JointDrive d = tree.drive(i);
    for (int r = 0; r < 6; ++r) J(r, base + d.dof) = J(r, base + d.dof) + column[r] * d.ratio;
  }
  if (!tree.free_base || link < 0) return;
  const Pose<T>& X_WB = kinematics.links[0].X_WL;
  for (int k = 0; k < 3; ++k) {  // turns about the axes of B at its origin, then moves along them
    const Vec3<T>& axis = X_WB.R.col[k];
    J.template block<3, 1>(0, k) = to_eigen(axis.template cast<R>());
    J.template block<3, 1>(3, k) = to_eigen(cross(axis, p_WF - X_WB.p));
    J.template block<3, 1>(3, 3 + k) = to_eigen(axis.template cast<R>());
  }
}

#ifdef DIFFNEA_COMPILED
#define DIFFNEA_EXTERN(P, S)                                                                  \
  extern template void forward_kinematics<P, S>(const Tree<P>&, VecIn<S>, VecIn<S>, VecIn<S>, \
                                                LinkKinematics<Prod<P, S>>&);                 \
  extern template void forward_kinematics<P, S>(const Tree<P>&, VecIn<S>,                     \
                                                LinkKinematics<Prod<P, S>>&);                 \
  extern template void forward_kinematics<P, S>(const Tree<P>&, const LinkStates<P, S>&,      \
                                                LinkKinematics<Prod<P, S>>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_EXTERN)
#undef DIFFNEA_EXTERN
#endif

}  // namespace diffnea
