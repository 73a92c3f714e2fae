#pragma once
/// What changed between two fits, as text for a terminal.

#include <string>

#include <diffnea/runs/result.hpp>

namespace diffnea {

/// The table that `diffnea compare` prints.
std::string compare_text(const Comparison& comparison);

}  // namespace diffnea
