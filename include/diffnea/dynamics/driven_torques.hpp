#pragma once
/// Inverse dynamics of a closed loop: torques of the driven joints alone. The passive ones have
/// none, and constraints do no work along the motions N that they leave, so that
///
///   N_dᵀ τ_d = Nᵀ τ_tree   (Nakamura, Ghodoussi 1989),   τ_tree = rnea(q, v, v̇) = Y π + I_r q̈
///
/// It is linear: what holds of torques holds of the regressor's columns, τ_d = D Y π + D I_r q̈.

#include <vector>

#include <diffnea/dynamics/constraint_projection.hpp>

namespace diffnea {

/// D, (driven × n_v), with τ_d = D τ_tree: D = (N_dᵀ)⁺ Nᵀ. Where more joints are driven than
/// motions are left, τ_d is the shortest of those that give the motion.
/// @param J  (m × n_v), of tree_rows
/// @param driven  coordinates, of n_v, in the order of the rows of D
/// @return D, or a matrix without rows where the driven joints do not hold all motions: too few of
///         them, or a posture at which one can move while they stand still (a dead point)
/// @throws ShapeError if a driven coordinate does not exist
MatX<double> driven_map(const MatX<double>& J, const std::vector<int>& driven);

}  // namespace diffnea

#include <diffnea/dynamics/detail/driven_torques_impl.hpp>
