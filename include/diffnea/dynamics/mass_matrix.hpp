#pragma once
/// Joint-space mass matrix: the composite-rigid-body algorithm (Featherstone 2008, Table 6.2).

#include <diffnea/dynamics/rnea.hpp>

namespace diffnea {

/// Scratch of the composite recursion.
template <Scalar P, Scalar S>
struct CompositeStates {
  /// Scalar of a product of parameter and state.
  using R = Prod<P, S>;
  std::vector<Pose<R>> X_PL;  ///< pose of every link in its parent, but a free base's
  std::vector<SpatialInertia<R>> composite;  ///< inertia of the link and all that hangs on it, in L
  JointScratch<S, R> joints;                 ///< where joints follow others, else unused
};

/// Scratch and result of `mass_matrix`.
template <Scalar P, Scalar S>
struct MassMatrixWorkspace : CompositeStates<P, S> {
  MatX<Prod<P, S>> M;  ///< M(q), (n × n) or (6 + n)², both triangles
};

/// M(q), (n × n), symmetric, rotor inertia I_r on the diagonal: τ = M q̈ + c(q, q̇). [kg·m², kg·m,
/// kg] With a free base (6 + n)²: rows and columns of its twist lead, and of q, (7 + n), the base's
/// pose does not matter.
/// @param q  (n) position [rad], [m] if prismatic
/// @param ws  scratch, overwritten; no allocation once it has seen this tree
/// @return ws.M
/// @throws as rnea
template <Scalar P, Scalar S>
const MatX<Prod<P, S>>& mass_matrix(const Tree<P>& tree, VecIn<S> q, MassMatrixWorkspace<P, S>& ws);

}  // namespace diffnea

#include <diffnea/dynamics/detail/mass_matrix_impl.hpp>
