#pragma once
/// What a grey box has learned: a torque without a name.

#include <string>

#include <diffnea/runs/diagnosis.hpp>

namespace diffnea::report {

/// Table of errors before and after, and every learned torque over its variables: a line with its
/// band, or a map. Empty where nothing was learned.
std::string grey_box_section(const Finding& finding);

}  // namespace diffnea::report
