#pragma once
/// Values of a part of a robot, which moved alone while it was identified, in the whole robot.
///
///     Model robot = read_model("robot.xml");
///     graft(robot, read_model_or_run("left_arm"));  // then those of the right arm

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea {

/// Gives links and joints of `whole` what `part` has of those that move there: inertias, poses,
/// effects at single joints. Of the lump that a link of `part` is with all that was fixed to it,
/// what moves in `whole` keeps its own inertia, and the link takes the rest.
/// @param part  links and joints that move there are found in `whole` by name
/// @return what is not put, one phrase each: "payload at tip"
/// @throws ModelError if a link or joint is not there or moves otherwise; if a lump, less what
///         moves in `whole`, is no body
std::vector<std::string> graft(Model& whole, const Model& part);

}  // namespace diffnea
