#pragma once
/// A fit as text for a terminal.

#include <string>

#include <diffnea/runs/result.hpp>

namespace diffnea {

/// One sentence with numbers: error before and after, and how much of the torque it is.
std::string identify_headline(const FitRun& run);

/// Parameters with uncertainties, errors before and after per joint, notes.
std::string identify_text(const FitRun& run);

}  // namespace diffnea
