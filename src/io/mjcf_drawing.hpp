#pragma once
/// An MJCF from nothing but a model: for models that came in another form.

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// A body for each link, a motor at each joint that is not passive (its limit is the effort limit),
/// sites for frames, damping, frictionloss, armature and springs, the posture `home` as a keyframe;
/// the ball with its string, the cup's dimensions, the obstacles as capsules. No looks.
/// @param delays  of drives are written, for MuJoCo 3.5
/// @param notes   gains what an MJCF cannot express, for the user
std::string draw_mjcf(const Model& model, bool delays, std::vector<std::string>& notes);

}  // namespace diffnea::io
