#pragma once
/// Joints that a recording does not move, and what is held because of it. Internal to identify/.

#include "identify/passes.hpp"

namespace diffnea {

/// A joint whose position stays within what its noise explains tells nothing of its own motion.
/// @param lowest, highest  (n) of the position [rad] or [m]
/// @param noise            (n) of its sensor; may be shorter
std::vector<int> motionless_joints(const VecX<double>& lowest, const VecX<double>& highest,
                                   const std::vector<double>& noise);

/// Holds what a motionless joint's recording cannot tell: all its effects but a constant torque.
/// @param names   of all joints
/// @param source  of the recording, for messages
/// @param notes   gets a line for each
/// @throws DataError if no joint moves
void hold_motionless(const std::vector<int>& joints, const std::vector<std::string>& names,
                     const std::string& source, FitLayout& layout, std::vector<std::string>& notes);

}  // namespace diffnea
