#pragma once
/// Forward dynamics: the articulated-body algorithm in Lie-group form (paper, Algorithm 1,
/// corrected).

#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea {

/// States of all links in an articulated-body recursion: one per tree, overwritten by every call.
template <Scalar P, Scalar S>
struct AbaStates : LinkStates<P, S> {
  /// Scalar of a product of parameter and state.
  using R = Prod<P, S>;
  /// What the backward pass leaves at a link (Featherstone 2008, Table 7.1).
  struct Articulated {
    ArticulatedInertia<R> M;  ///< M̂, the inertia of the link and all that hangs on it
    Wrench<R> f_b;            ///< bias force
    Wrench<R> U;              ///< M̂ s
    R psi;                    ///< Ψ = (sᵀ M̂ s + I_r)⁻¹
  };
  std::vector<Articulated> articulated;  ///< one per link
  CompositeStates<P, S> composite;       ///< where joints follow others, else unused
  std::vector<R> M;                      ///< (n × n) of the coordinates, likewise
};

/// Scratch and result of `aba`.
template <Scalar P, Scalar S>
struct AbaWorkspace : AbaStates<P, S> {
  VecX<Prod<P, S>> qdd;  ///< q̈, (n) [rad/s²], [m/s²] if prismatic
};

/// Joint accelerations q̈ [rad/s²], (n), under torques u at (q, q̇): O(n); where joints follow others
/// by the mass matrix, O(n³), which leaves `articulated` as it was. Passive torques of effects
/// (friction, springs) are the caller's: pass u − τ_effects.
/// Corrected against the print: the bias force holds the link's own inertia M̄, not M̂; q̈ takes +f_b;
/// the world accelerates by −g; the rotor inertia I_r enters Ψ. With a free base, lengths are those
/// of rnea: the wrench on the base leads u (zero in the air), V̇ = M̂⁻¹(F − f_b) of the base leads q̈
/// (model/tree.hpp).
/// @param q, qd, u  (n) position [rad], velocity [rad/s], joint torque [N·m]; [m, m/s, N] if
/// prismatic
/// @param ws  scratch, overwritten: every link's twist, acceleration and wrench stay readable
/// there;
///            no allocation once it has seen this tree
/// @return ws.qdd
/// @throws as rnea
template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& aba(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd, VecIn<S> u,
                            AbaWorkspace<P, S>& ws);

}  // namespace diffnea

#include <diffnea/dynamics/detail/aba_impl.hpp>
