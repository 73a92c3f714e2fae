#pragma once
/// Whether an MJCF that values were put into says them: defaults, options of the compiler and
/// whatever comes with MuJoCo's next version may overrule what an element states.

#include <mujoco/mujoco.h>

#include <diffnea/model/model.hpp>

#include "io/mjcf.hpp"

namespace diffnea::io {

/// Compares links, joints, inertias, friction, springs and ranges of the joints, gravity, and the
/// ball with its string.
/// @param written  compiled from what is to be kept
/// @param model  what it is to say; a range that no MJCF can say is none
/// @param mjcf  the document that holds the values
/// @throws ModelError `where: …` naming the first value that is another
void require_it_says(const mjModel& written, const Model& model, const Mjcf& mjcf);

}  // namespace diffnea::io
