#pragma once
/// Equality constraints of an MJCF that are no loops (mjcf_loops.hpp). Those between two joints,
/// straight lines, are what a tree can have: one joint follows the other.

#include <optional>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "io/mjcf.hpp"

namespace diffnea::io {

/// Effect of the constraints on a joint.
struct JointCoupling {
  std::optional<Follow> follows;    ///< another joint
  std::optional<double> locked_at;  ///< a position that it keeps [rad, m]
};

/// Couplings, one per joint of `m`. Constraints that are neither couplings nor loops are refused,
/// or noted where loops may stay open: then all constraints are left out.
/// @param left_out  bodies that are no links: what holds these does not matter
/// @throws ModelError naming constraint, line, and what to do
std::vector<JointCoupling> joint_couplings(const mjModel& m, const std::vector<bool>& left_out,
                                           const Mjcf& mjcf, std::vector<std::string>& notes);

}  // namespace diffnea::io
