#pragma once

#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea {

namespace detail {

/// Featherstone 2008, Table 6.2.
template <Scalar P, Scalar S>
void mass_matrix(const Tree<P>& tree, const S* q, MassMatrixWorkspace<P, S>& ws) {
  using R = Prod<P, S>;
  const int n = tree.num_dofs();
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
      ws.M(i, i) = dot(s, F) + link.armature;
    });
    for (int j = i; tree.links[j].parent >= 0;) {
      F = to_parent(ws.X_PL[j], F);
      j = tree.links[j].parent;
      with_axis(tree.links[j], [&](const auto& s) { ws.M(i, j) = ws.M(j, i) = dot(s, F); });
    }
  }
}

}  // namespace detail

template <Scalar P, Scalar S>
const MatX<Prod<P, S>>& mass_matrix(const Tree<P>& tree, VecIn<S> q,
                                    MassMatrixWorkspace<P, S>& ws) {
  const int n = tree.num_dofs();
  require_size("mass_matrix: q", q.size(), n, "joint");
  ws.X_PL.resize(n);
  ws.composite.resize(n);
  ws.M.setConstant(n, n, Prod<P, S>(0.0));
  call_inlined<Prod<P, S>>([&] { detail::mass_matrix(tree, q.data(), ws); });
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
