#pragma once
/// The verdict of a diagnosis as a sentence with numbers.

#include <string>

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

std::string sentence(const Finding& finding);

}  // namespace diffnea::report
