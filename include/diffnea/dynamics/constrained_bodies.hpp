#pragma once
/// Accelerations and impulses of bodies under constraints, with the constraints' forces
/// in closed form: with A = J M̄⁻¹ Jᵀ and the accelerations V̇₀ that the bodies would have without,
///
///   f_c = −Jᵀ λ,   A λ = J V̇₀ + γ − g̈*,   g̈* = −K_p g − K_d ġ  (Baumgarte 1972)
///
/// Inequalities g ≤ 0 take part where g ≥ −kTouching; g̈* is at most 0 there, and λ ≥ 0 with
/// complementarity: 0 ≤ λ ⊥ g̈* − g̈ ≥ 0, solved exactly by principal pivoting (Murty 1974). Rows
/// that others imply (redundant ones) are left out: the motion is unique where the forces are not.
/// Every step is a smooth function of state and parameters except the choice of rows, so that Jets
/// pass through.

#include <diffnea/dynamics/constraint.hpp>

namespace diffnea {

/// What rounding leaves of an inequality that is tight, in its unit.
inline constexpr double kTouching = 1e-9;

/// g̈* = −kp g − kd ġ of poses; ġ* = −kd g of velocities. Zero: nothing pulls a drift back.
struct Stabilisation {
  double kp = 0.0;  ///< [1/s²]
  double kd = 0.0;  ///< [1/s]
  /// Critically damped, time constant `seconds`.
  static Stabilisation within(double seconds) { return {1.0 / (seconds * seconds), 2.0 / seconds}; }
};

/// Accelerations of the bodies, and the constraints' forces.
template <Scalar T>
struct ConstrainedAcceleration {
  std::vector<Twist<T>> Vd;      ///< V̇ per body, in B [rad/s², m/s²]
  std::vector<Wrench<T>> force;  ///< f_c per body, in B [N·m, N]
  std::vector<T> multiplier;     ///< λ per row; 0 where inactive or redundant
};

/// Accelerations of all bodies.
/// @param states, applied  one per body; `applied` wrenches f̄_u without weight, in B [N·m, N]; of a
///        prescribed body `applied` is not read
/// @param prescribed  V̇ of prescribed bodies, one per body (others are not read); empty: zero
/// @param rows  of all constraints at this state (append_rows)
/// @param gravity  in W [m/s²]
/// @throws ShapeError if lengths differ; ModelError if constraints contradict each other, or no
///         choice of active inequalities is consistent, naming those without which the others
///         agree; or if a body has no mass
template <Scalar T>
ConstrainedAcceleration<T> constrained_acceleration(const std::vector<FreeBody<T>>& bodies,
                                                    const std::vector<BodyState<T>>& states,
                                                    const std::vector<Wrench<T>>& applied,
                                                    const std::vector<Twist<T>>& prescribed,
                                                    const std::vector<ConstraintRow<T>>& rows,
                                                    const Vec3<T>& gravity,
                                                    const Stabilisation& stabilisation);

/// The same at a measured state, every row an equality, inequalities too: V̇ nearest to V̇₀ in M̄
/// that all rows agree on, g̈ = 0 in least squares where noise makes redundant ones contradict.
/// @param rows  those that act  @throws ShapeError, ModelError as constrained_acceleration
template <Scalar T>
ConstrainedAcceleration<T> held_acceleration(const std::vector<FreeBody<T>>& bodies,
                                             const std::vector<BodyState<T>>& states,
                                             const std::vector<Wrench<T>>& applied,
                                             const std::vector<Twist<T>>& prescribed,
                                             const std::vector<ConstraintRow<T>>& rows,
                                             const Vec3<T>& gravity);

/// Rows that act: equalities, and inequalities that hold something back.
std::vector<bool> active_rows(const std::vector<ConstraintRow<double>>& rows,
                              const std::vector<double>& multiplier);

/// Active rows that others imply: their Jacobian is in the span of those before them, rows with a
/// force first. The motion is unique where these forces are not.
/// @param rows, multiplier  of constrained_acceleration  @throws ShapeError if lengths differ
std::vector<bool> redundant_rows(const std::vector<FreeBody<double>>& bodies,
                                 const std::vector<ConstraintRow<double>>& rows,
                                 const std::vector<double>& multiplier);

/// Twists after an impact: rows of poses that are violated or touch (g ≥ −kTouching) end with ġ ≤
/// 0, or with −restitution times ġ before; equalities end with ġ = 0 and g(X, V) = 0. Momentum
/// along Jᵀ alone changes (Moreau 1988).
/// @return V after it, one per body; prescribed bodies keep theirs
/// @throws as constrained_acceleration
template <Scalar T>
std::vector<Twist<T>> after_impact(const std::vector<FreeBody<T>>& bodies,
                                   const std::vector<BodyState<T>>& states,
                                   const std::vector<ConstraintRow<T>>& rows,
                                   double restitution = 0.0);

}  // namespace diffnea

#include <diffnea/dynamics/detail/constrained_bodies_impl.hpp>
#ifndef DIFFNEA_COMPILED
#include <diffnea/dynamics/detail/constraint_rows_impl.hpp>
#endif
