#pragma once
/// A diagnosis in words with numbers: for how long the simulation follows the robot, then the
/// verdict.

#include <string>

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

std::string sentence(const Finding& finding);

}  // namespace diffnea::report
