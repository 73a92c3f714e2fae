#pragma once
/// States of a constrained tree: the nearest that satisfy its constraints, and the motions that its
/// constraints leave. For `double`.

#include <diffnea/dynamics/constrained_tree.hpp>

namespace diffnea {

/// Stop rule of `project_positions`, and what it may move.
struct ProjectionOptions {
  std::vector<int> held;     ///< coordinates, of n_v, that keep their value: those that are driven
  double tolerance = 1e-12;  ///< largest |g|, in the constraints' units, that counts as closed
  int most_steps = 50;       ///< Gauss–Newton steps before it gives up
};

/// Outcome of `project_positions`.
struct ProjectedPositions {
  VecX<double> q;          ///< (n), (7 + n) with a free base: the best that was found
  double residual = 0.0;   ///< largest |g| there, in the constraints' units
  int steps = 0;           ///< Gauss–Newton steps that were taken
  bool converged = false;  ///< residual ≤ tolerance
};

/// Positions on g(q) = 0 near q: Gauss–Newton, q ← q ⊕ −J⁺g with the shortest step, halved where
/// the residual would grow. Inequalities count where they are violated, constraints of velocities
/// do not.
/// @param q  (n), (7 + n) with a free base [rad, m]
/// @throws as tree_rows; ShapeError if a held coordinate does not exist
template <class Constraints>
ProjectedPositions project_positions(const Tree<double>& tree, const Constraints& constraints,
                                     VecIn<double> q, const ProjectionOptions& options = {});

/// Velocities with J v = 0, and g(X, V) = 0, that are nearest to v: v − J⁺(J v).
/// @param v  (n_v)  @param held  coordinates, of n_v, that keep their value
/// @throws as project_positions
template <class Constraints>
VecX<double> project_velocities(const Tree<double>& tree, const Constraints& constraints,
                                VecIn<double> q, VecIn<double> v,
                                const std::vector<int>& held = {});

/// Accelerations with J v̇ + γ = 0 that are nearest to vd.
/// @param v, vd  (n_v)  @param held  coordinates, of n_v, that keep their value
/// @throws as project_positions
template <class Constraints>
VecX<double> project_accelerations(const Tree<double>& tree, const Constraints& constraints,
                                   VecIn<double> q, VecIn<double> v, VecIn<double> vd,
                                   const std::vector<int>& held = {});

/// Share of the largest singular value below which one counts as 0.
inline constexpr double kRankTol = 1e-9;

/// N, (n_v × (n_v − rank J)), orthonormal columns with J N = 0: motions that constraints leave.
/// @param J  (m × n_v), of tree_rows
MatX<double> constraint_null_space(const MatX<double>& J);

}  // namespace diffnea

#include <diffnea/dynamics/detail/constraint_projection_impl.hpp>
