#pragma once
/// A constraint is written once, as a function: of poses (holonomic, g(X) = 0 or g(X) ≤ 0) or of
/// poses and twists (nonholonomic, g(X, V) = 0). What the dynamics need of it is differentiated:
///
///   ġ = J V,   g̈ = J V̇ + γ,   γ = d²/dt² g(X exp(V t)) at t = 0        (of poses)
///   ġ = J V̇ + γ,   γ = d/dt g(X exp(V t), V)                           (of poses and twists)
///
/// Such a function is a struct with
///
///     static constexpr int kBodies, kRows;
///     static constexpr Relation kRelation;
///     template <class T>
///     std::array<T, kRows> operator()(const std::array<Pose<T>, kBodies>&) const;
///
/// or with a second argument, std::array<Twist<T>, kBodies>, the bodies' twists in their frames. If
/// the number of rows is known at run time alone, it returns std::vector<T> and has no kRows.
/// dynamics/constraints.hpp has examples: rod, hinge, string, rolling wheel, skate.

#include <array>
#include <string>
#include <vector>

#include <diffnea/core/dual.hpp>
#include <diffnea/dynamics/free_body.hpp>

namespace diffnea {

/// Whether a constraint holds both ways or one.
enum class Relation {
  kEqual,   ///< g = 0
  kAtMost,  ///< g ≤ 0; its force can only hold back: f = −Jᵀλ, λ ≥ 0
};

/// Index of the world among the bodies of a constraint: it stands still at the identity.
inline constexpr int kWorld = -1;
inline constexpr int kMostBodies = 2;  ///< a constraint ties one body or two

/// A function of poses: holonomic.
template <class C>
concept PoseConstraint =
    requires(const C& c, const std::array<Pose<double>, C::kBodies>& X) { c(X); };
/// A function of poses and twists: nonholonomic.
template <class C>
concept VelocityConstraint = requires(const C& c, const std::array<Pose<double>, C::kBodies>& X,
                                      const std::array<Twist<double>, C::kBodies>& V) { c(X, V); };
/// Either, of one body or two.
template <class C>
concept Constraint =
    (PoseConstraint<C> || VelocityConstraint<C>) && C::kBodies <= kMostBodies && requires {
      { C::kRelation } -> std::convertible_to<Relation>;
    };

/// One scalar equation or inequality at a state, linear in the accelerations.
template <Scalar T>
struct ConstraintRow {
  std::string name;                      ///< of the constraint it is a row of, for errors
  Relation relation = Relation::kEqual;  ///< of g to 0
  bool of_velocity = false;              ///< g is of poses and twists, not of poses alone
  std::array<int, kMostBodies> bodies{kWorld, kWorld};  ///< indices; kWorld: the world, or none
  std::array<Wrench<T>, kMostBodies> J{};  ///< ∂ġ/∂V (of poses) or ∂g/∂V, a covector per body
  T g{},                                   ///< g, in the constraint's unit
      gd{};                                ///< ġ [that unit/s]; not known, and zero, if of_velocity
  T bias{};                                ///< γ
};

/// Rows of a constraint between `bodies` (indices into `states`, or kWorld) at a state.
/// @param name  as errors name it
/// @throws ShapeError if a body does not exist
template <Scalar T, Constraint C>
void append_rows(const C& constraint, const std::string& name,
                 const std::array<int, C::kBodies>& bodies, const std::vector<BodyState<T>>& states,
                 std::vector<ConstraintRow<T>>& rows);

}  // namespace diffnea

#include <diffnea/dynamics/detail/constraint_impl.hpp>
