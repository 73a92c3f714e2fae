#pragma once
/// Equality constraints of an MJCF, of which a tree of independent joints has none.

#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "io/mjcf.hpp"

namespace diffnea::io {

/// Refuses constraints between links, or notes them where loops may stay open.
/// @param left_out  bodies that are no links: what holds these does not matter
/// @throws ModelError naming constraint, line, and what to do
void look_for_closed_loops(const mjModel& m, const std::vector<bool>& left_out, const Mjcf& mjcf,
                           std::vector<std::string>& notes);

}  // namespace diffnea::io
