#pragma once
/// Joints that a recording does not move, and what is held because of it. Internal to identify/.

#include "identify/passes.hpp"

namespace diffnea {

/// A joint whose filtered position stays within what its noise explains tells nothing of its own
/// motion.
std::vector<int> motionless_joints(const Pass& pass, const PreprocessPlan& plan);

/// What a motionless joint's recording cannot tell: all its effects but a constant torque.
void hold_motionless(const std::vector<int>& joints, FitLayout& layout);

}  // namespace diffnea
