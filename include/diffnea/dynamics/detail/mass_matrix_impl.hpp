#pragma once

#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea {

namespace detail {

/// Featherstone 2008, Table 6.2, of all joints: fills M, one row and column a joint.
template <Scalar P, Scalar S>
void mass_matrix_of_joints(const Tree<P>& tree, const S* q, CompositeStates<P, S>& ws,
                           Prod<P, S>* M) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  for (int k = 0; k < n * n; ++k) M[k] = R(0.0);
  for (int i = 0; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    const SpatialInertia<P>& b = link.inertia;
    with_axis(link, [&](const auto& s) { ws.X_PL[i] = joint_pose(link, s, q[i]); });
    ws.composite[i] = {R(b.m), b.h.template cast<R>(), b.I.template cast<R>()};
  }
  for (int i = n - 1; i >= 0; --i) {
    const Link<P>& link = tree.links[i];
    if (link.parent >= 0) {
      SpatialInertia<R>& p = ws.composite[link.parent];
      p = p + to_parent(ws.X_PL[i], ws.composite[i]);
    }
    Wrench<R> F;  // what accelerates the subtree when joint i does, by 1
    with_axis(link, [&](const auto& s) {
      F = ws.composite[i] * s;
      M[i * n + i] = dot(s, F) + link.armature;
    });
    for (int j = i; tree.links[j].parent >= 0;) {
      F = to_parent(ws.X_PL[j], F);
      j = tree.links[j].parent;
      with_axis(tree.links[j], [&](const auto& s) { M[i * n + j] = M[j * n + i] = dot(s, F); });
    }
  }
}

/// Fills M of the coordinates, (n × n): Gᵀ M G.
template <Scalar P, Scalar S>
void mass_matrix(const Tree<P>& tree, const S* y, CompositeStates<P, S>& ws, Prod<P, S>* M) {
  using R = Prod<P, S>;
  const int n = tree.num_dofs(), links = tree.num_links();
  const Coordinates& c = tree.coordinates;
  ws.X_PL.resize(links);
  ws.composite.resize(links);
  if (!c.plain()) ws.joints.tau.resize(static_cast<std::size_t>(links * links));
  R* of_joints = c.plain() ? M : ws.joints.tau.data();
  mass_matrix_of_joints(tree, c.of_joints(y, true, ws.joints.q), ws, of_joints);
  if (c.plain()) return;
  for (int k = 0; k < n * n; ++k) M[k] = R(0.0);
  for (int i = 0; i < links; ++i)
    for (int j = 0; j < links; ++j) {
      const JointDrive a = tree.drive(i), b = tree.drive(j);
      R& sum = M[a.dof * n + b.dof];
      sum = sum + of_joints[i * links + j] * (a.ratio * b.ratio);
    }
}

}  // namespace detail

template <Scalar P, Scalar S>
const MatX<Prod<P, S>>& mass_matrix(const Tree<P>& tree, VecIn<S> q,
                                    MassMatrixWorkspace<P, S>& ws) {
  const int n = tree.num_dofs();
  require_size("mass_matrix: q", q.size(), n, "joint");
  ws.M.resize(n, n);
  call_inlined<Prod<P, S>>([&] { detail::mass_matrix(tree, q.data(), ws, ws.M.data()); });
  return ws.M;
}

#ifdef DIFFNEA_COMPILED
#define DIFFNEA_EXTERN(P, S)                                                          \
  extern template const MatX<Prod<P, S>>& mass_matrix<P, S>(const Tree<P>&, VecIn<S>, \
                                                            MassMatrixWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_EXTERN)
#undef DIFFNEA_EXTERN
#endif

}  // namespace diffnea
