#pragma once
/// Torque regressor: joint torques are linear in the ten inertial parameters of every link.

#include <diffnea/dynamics/rnea.hpp>

namespace diffnea {

/// What the regressor needs of a link.
template <Scalar T>
struct RegressorLinkMotion {
  Pose<T> X_WL;  ///< pose of the link in W
  Twist<T> V;    ///< twist of L against W, in L
  Twist<T> A;    ///< its spatial acceleration minus gravity, in L
  Twist<T> s_W;  ///< the joint's axis in W, moment about W's origin
};

/// Scratch of `torque_regressor`.
template <Scalar P, Scalar S>
struct RegressorWorkspace {
  std::vector<RegressorLinkMotion<Prod<P, S>>> links;  ///< one per link
  RowMatX<Prod<P, S>> Y;                               ///< (n × 10 links) or ((6 + n) × 10 links)
};

/// Y(q, q̇, q̈), (n × 10 links), with τ = Y π + I_r q̈: π stacks θ = [m, h, I] of the links in the
/// order of the tree (lie/inertia.hpp; model/model.hpp, inertial_parameters). Rotor inertia is
/// not in π. Column block k of row i is sᵢᵀ ∂f̄ₖ/∂θₖ, zero unless joint i carries link k. Only the
/// tree's geometry is read, not its inertias. (Atkeson, An, Hollerbach 1986; here each sᵢ
/// moves to link k, which is a twist, where they move the 6×10 matrix of link k.)
/// With a free base ((6 + n) × 10 links): six rows of the wrench on it lead, and π begins with the
/// base's ten.
/// @param q, qd, qdd  (n) position [rad], velocity [rad/s], acceleration [rad/s²]; [m …] if
/// prismatic
/// @param ws  scratch, overwritten; no allocation once it has seen this tree
/// @return ws.Y, row units [N·m] per [kg, kg·m, kg·m²]
/// @throws as rnea
template <Scalar P, Scalar S>
const RowMatX<Prod<P, S>>& torque_regressor(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd,
                                            VecIn<S> qdd, RegressorWorkspace<P, S>& ws);

}  // namespace diffnea

#include <diffnea/dynamics/detail/regressor_impl.hpp>
