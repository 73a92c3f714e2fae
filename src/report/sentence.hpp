#pragma once
/// What a diagnosis comes to: for how long the simulation follows the robot, then the verdict, with
/// numbers.

#include <string>

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

std::string sentence(const Finding& finding);

}  // namespace diffnea::report
