#pragma once
/// Joints that are held for good: those that a recording lacks, say.
///
///     lock_joint(model, "head_1_joint", 0.2);  // a fixed joint from here on, at 0.2 rad

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea {

/// Where a joint rests if nobody says: at the model's `home`, else at 0, moved into its limits.
/// [rad, m]
/// @throws ModelError as find_joint
double resting_position(const Model& model, const std::string& joint);

/// Makes a moving joint a fixed one, at `position` [rad, m]; its link keeps name and inertia and
/// becomes part of what carries it. Effects of the joint go, and the posterior of a fit, which was
/// made of a robot that could move there.
/// @return what went, one phrase each: "coulomb_friction at head_1_joint"
/// @throws ModelError as find_joint; if the position is beyond the joint's limits by more than a
///         twentieth of their range, or is not finite
std::vector<std::string> lock_joint(Model& model, const std::string& joint, double position);

}  // namespace diffnea
