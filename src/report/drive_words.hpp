#pragma once
/// Drives that differ from the description, in words.

#include <string>
#include <vector>

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

/// "The drives differ from the description: dead band at elbow, stiffness at 6 joints."; empty
/// where the recordings refute none of their numbers.
std::string drives_sentence(const Finding& finding);
/// Joint, what, described, fitted and unit of each number that is refuted; the first ones, and how
/// many more there are.
std::vector<std::vector<std::string>> drive_rows(const Finding& finding);

}  // namespace diffnea::report
