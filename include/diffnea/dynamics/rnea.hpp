#pragma once
/// Inverse dynamics: recursive Newton–Euler in Lie-group form (paper, Algorithm 2, corrected).

#include <vector>

#include <diffnea/model/tree.hpp>

namespace diffnea {

/// Scratch of the recursions, and what they know of every link once they have run.
template <Scalar P, Scalar S>
struct LinkStates {
  /// Scalar of a product of parameter and state.
  using R = Prod<P, S>;
  /// What the forward pass leaves at a link.
  struct State {
    Pose<R> X_PL;  ///< pose of the link in its parent
    Twist<R> V;    ///< twist of L against W, in L
    Twist<R> A;    ///< its spatial acceleration minus gravity (that of the world: [0; −g]), in L
    Wrench<R> F;   ///< wrench that the parent transmits through the joint, about L's origin, in L
  };
  std::vector<State> links;   ///< one per link; of a free base F is the wrench on it
  JointScratch<S, R> joints;  ///< where joints follow others: all of them, else unused
};

/// Scratch and result of `rnea`.
template <Scalar P, Scalar S>
struct RneaWorkspace : LinkStates<P, S> {
  VecX<Prod<P, S>> tau;  ///< τ, (n) or (6 + n) [N·m], [N] if prismatic
};

/// Joint torques τ [N·m], (n), that produce q̈ at (q, q̇), rotor inertia included: O(n).
/// Twists and wrenches are expressed in their link L (paper, Algorithm 2; Featherstone 2008,
/// Table 5.1). With a free base q is (7 + n), and the others are (6 + n): the twist of the base and
/// its derivative lead q̇ and q̈, the wrench that it needs leads τ (model/tree.hpp).
/// @param q, qd, qdd  (n) position [rad], velocity [rad/s], acceleration [rad/s²]; [m …] if
/// prismatic
/// @param ws  scratch, overwritten: every link's twist, acceleration and wrench stay readable
/// there;
///            no allocation once it has seen this tree
/// @return ws.tau
/// @throws ShapeError if a length differs from tree.num_positions() or tree.num_velocities()
/// @throws DataError if the quaternion of a free base is not unit
template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& rnea(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd, VecIn<S> qdd,
                             RneaWorkspace<P, S>& ws);

/// Torques that hold the tree still against gravity at q: rnea(q, 0, 0).
/// @param q (n) [rad], (7 + n) with a free base  @throws as rnea
template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& gravity_torques(const Tree<P>& tree, VecIn<S> q, RneaWorkspace<P, S>& ws);

}  // namespace diffnea

#include <diffnea/dynamics/detail/rnea_impl.hpp>
