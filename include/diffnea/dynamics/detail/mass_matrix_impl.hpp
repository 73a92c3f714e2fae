#pragma once

#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea {

namespace detail {

/// M̄ of the whole tree about a free base, into the six leading rows and columns of M, (n × n).
template <class R>
void base_block(const SpatialInertia<R>& whole, R* M, int n) {
  for (int r = 0; r < kBaseVelocities; ++r) {
    R unit[kBaseVelocities] = {R(0.0), R(0.0), R(0.0), R(0.0), R(0.0), R(0.0)};
    unit[r] = R(1.0);
    const Wrench<R> F = whole * base_twist(unit);
    write_base(F.torque, F.force, M + r * n);
  }
}

/// Featherstone 2008, Table 6.2, of all joints: fills M, one row and column a joint, behind six of
/// a free base. Where that is does not matter: all is in B.
template <class Floats, Scalar P, Scalar S>
void mass_matrix_of_joints(Floats floats, const Tree<P>& tree, const S* q,
                           CompositeStates<P, S>& ws, Prod<P, S>* M) {
  using R = Prod<P, S>;
  const int first = floats ? 1 : 0;                    // link that a joint moves
  const int shift = floats ? kBaseVelocities - 1 : 0;  // row against index
  const int links = tree.num_links(), n = links + shift;
  for (int k = 0; k < n * n; ++k) M[k] = R(0.0);
  for (int i = 0; i < links; ++i) {
    const Link<P>& link = tree.links[i];
    const SpatialInertia<P>& b = link.inertia;
    if (i >= first)
      with_axis(link, [&](const auto& s) { ws.X_PL[i] = joint_pose(link, s, q[i - first]); });
    ws.composite[i] = {R(b.m), b.h.template cast<R>(), b.I.template cast<R>()};
  }
  for (int i = links - 1; i >= first; --i) {
    const Link<P>& link = tree.links[i];
    const int row = i + shift;
    if (link.parent >= 0) {
      SpatialInertia<R>& p = ws.composite[link.parent];
      p = p + to_parent(ws.X_PL[i], ws.composite[i]);
    }
    Wrench<R> F;  // what accelerates the subtree when joint i does, by 1
    with_axis(link, [&](const auto& s) {
      F = ws.composite[i] * s;
      M[row * n + row] = dot(s, F) + link.armature;
    });
    for (int j = i; tree.links[j].parent >= 0;) {
      F = to_parent(ws.X_PL[j], F);
      j = tree.links[j].parent;
      if (floats && j == 0) {
        write_base(F.torque, F.force, M + row * n);
        for (int r = 0; r < kBaseVelocities; ++r) M[r * n + row] = M[row * n + r];
        break;
      }
      const int column = j + shift;
      with_axis(tree.links[j],
                [&](const auto& s) { M[row * n + column] = M[column * n + row] = dot(s, F); });
    }
  }
  if (floats) base_block(ws.composite[0], M, n);
}

/// Fills M of the coordinates, (6 + n) of a free base, else (n): Gᵀ M G.
template <Scalar P, Scalar S>
void mass_matrix(const Tree<P>& tree, const S* y, CompositeStates<P, S>& ws, Prod<P, S>* M) {
  using R = Prod<P, S>;
  const int n = tree.num_velocities(), base = n - tree.num_dofs();
  const Coordinates& c = tree.coordinates;
  ws.X_PL.resize(tree.links.size());
  ws.composite.resize(tree.links.size());
  const int joints = base + tree.num_joints();
  if (!c.plain()) ws.joints.tau.resize(static_cast<std::size_t>(joints * joints));
  R* of_joints = c.plain() ? M : ws.joints.tau.data();
  const S* q = c.of_joints(joints_in_positions(tree, y), true, ws.joints.q);
  with_base<Prod<P, S>>(
      tree, [&](auto floats) { mass_matrix_of_joints(floats, tree, q, ws, of_joints); });
  if (c.plain()) return;
  for (int k = 0; k < n * n; ++k) M[k] = R(0.0);
  const auto drive = [&](int row) {  // rows of the base are coordinates of their own
    if (row < base) return JointDrive{row, 1.0, 0.0};
    const JointDrive d = c.joints[row - base];
    return JointDrive{d.dof + base, d.ratio, d.offset};
  };
  for (int i = 0; i < joints; ++i)
    for (int j = 0; j < joints; ++j) {
      const JointDrive a = drive(i), b = drive(j);
      R& sum = M[a.dof * n + b.dof];
      sum = sum + of_joints[i * joints + j] * (a.ratio * b.ratio);
    }
}

}  // namespace detail

template <Scalar P, Scalar S>
const MatX<Prod<P, S>>& mass_matrix(const Tree<P>& tree, VecIn<S> q,
                                    MassMatrixWorkspace<P, S>& ws) {
  const int n = tree.num_velocities();
  require_positions("mass_matrix: q", tree, q);
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
