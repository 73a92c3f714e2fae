#pragma once
/// Trees whose links are tied to each other, or to the world, by constraints of any kind
/// (dynamics/constraint.hpp): closed loops, wheels that roll. With v̇ = q̈, or of a free base
/// [ω̇; v̇ | joints], and h = rnea(q, v, 0),
///
///   M v̇ = τ − h − Jᵀλ,   J v̇ + γ = g̈*,   g̈* = −K_p g − K_d ġ  (Baumgarte 1972)
///   J M⁻¹Jᵀ λ = J M⁻¹(τ − h) + γ − g̈*  (Featherstone 2008, eq. 8.14)
///
/// Rows and λ are those of dynamics/constrained_bodies.hpp, and so is what happens to inequalities,
/// to redundant rows and to contradictions. Constraints come as a function that appends their rows,
/// links in place of bodies:
///
///     const auto loop = [&](const auto& links, auto& rows) {
///       append_rows(BallJoint<double>{p_AP, p_BQ}, "pin", {coupler, rocker}, links, rows);
///     };
///     constrained_forward_dynamics<double, double>(tree, loop, q, qd, tau, {}, ws);

#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea {

/// Rows of all constraints at a state, in the links' twists and in the tree's coordinates.
template <Scalar T>
struct TreeRows {
  std::vector<ConstraintRow<T>> rows;  ///< m, as appended: their bodies are links of the tree
  MatX<T> J;                           ///< (m × n_v), ġ = J v, or of velocities ∂g/∂v
  VecX<T> bias;                        ///< (m) γ: g̈ = J v̇ + γ, or of velocities ġ
};

/// Scratch and results of `constrained_forward_dynamics`, R the product of parameter and state.
template <Scalar P, Scalar S>
struct ConstrainedTreeWorkspace {
  /// Scalar of a product of parameter and state.
  using R = Prod<P, S>;
  RneaWorkspace<P, S> rnea;         ///< state at v̇ = 0
  MassMatrixWorkspace<P, S> mass;   ///< M(q)
  LinkKinematics<R> kinematics;     ///< motion at v̇ = 0
  std::vector<BodyState<R>> links;  ///< pose in W and twist in L of every link
  TreeRows<R> constraints;          ///< their rows at the state
  VecX<R> qdd,                      ///< v̇, (n_v) [rad/s², m/s²]
      multiplier,                   ///< λ, (m); 0 where inactive or redundant
      force;                        ///< −Jᵀλ, (n_v): torques of the constraints [N·m, N]
};

/// Accelerations under torques and constraints, with the constraints' forces in closed form. Jets
/// pass through, of state and of parameters.
/// @param constraints  called with (const std::vector<BodyState<R>>& links,
///        std::vector<ConstraintRow<R>>& rows); appends rows (append_rows)
/// @param q  (n), (7 + n) with a free base [rad, m]
/// @param v, tau  (n_v) velocity [rad/s, m/s], torque [N·m, N]
/// @param ws  scratch, overwritten; multipliers and forces of the constraints stay readable there
/// @return ws.qdd
/// @throws as rnea, append_rows and constrained_acceleration; ModelError if M is singular:
/// something
///         that moves has no inertia
template <Scalar P, Scalar S, class Constraints>
const VecX<Prod<P, S>>& constrained_forward_dynamics(const Tree<P>& tree,
                                                     const Constraints& constraints, VecIn<S> q,
                                                     VecIn<S> v, VecIn<S> tau,
                                                     const Stabilisation& stabilisation,
                                                     ConstrainedTreeWorkspace<P, S>& ws);

/// Rows at a state, from its kinematics with v̇ = 0.
/// @param links, out  overwritten
/// @throws ShapeError if a row names a link that is not there
template <Scalar P, Scalar T, class Constraints>
void tree_rows(const Tree<P>& tree, const Constraints& constraints,
               const LinkKinematics<T>& kinematics, std::vector<BodyState<T>>& links,
               TreeRows<T>& out);

/// The same at (q, v). @param v  (n_v)  @throws as forward_kinematics and append_rows
template <class Constraints>
TreeRows<double> tree_rows(const Tree<double>& tree, const Constraints& constraints,
                           VecIn<double> q, VecIn<double> v);

}  // namespace diffnea

#include <diffnea/dynamics/detail/constrained_tree_impl.hpp>
