#pragma once
/// Posture that closes a robot's loops, the nearest to a given one. Internal to the library.

#include <vector>

#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/tree_constraints.hpp>

namespace diffnea {

/// Largest residual of a closed loop [m, rad].
inline constexpr double kClosedLoop = 1e-9;

/// Stop rule of postures that close but for rounding.
/// @param held  coordinates that keep their value
ProjectionOptions closing(const std::vector<int>& held);

/// Indices of the degrees of freedom with a drive.
std::vector<int> driven_joints(const Model& model);

/// Where a search for a closed posture has ended.
struct ClosedPosture {
  VecX<double> q;  ///< where it has ended; closed, where `closes` says so
  bool closes = false;
  double residual = 0.0;  ///< largest one there, in the constraints' units
};

/// Gauss–Newton from a posture; where that ends open or at a dead point of the drives, as in a
/// linkage that is stretched out, from random ones around it, the same at every call. Of those that
/// close the nearest counts, within the joints' limits and firmly held by the drives first. Frames
/// of welds and axes of hinges that are half a turn apart are not closed, though their rows are 0
/// there, too (dynamics/constraints.hpp).
/// @param tree, constraints  the model's
/// @param q  (n), of a free base (7 + n), whose pose is not varied
ClosedPosture closed_posture(const Model& model, const Tree<double>& tree,
                             const TreeConstraints<double>& constraints, const VecX<double>& q);

}  // namespace diffnea
