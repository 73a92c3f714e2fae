#pragma once
/// A diagnosis as text for a terminal.

#include <string>

#include <diffnea/runs/diagnosis.hpp>

namespace diffnea {

/// Verdict, causes with uncertainties and rivals, gain per joint, what cannot be seen.
std::string diagnose_text(const DiagnoseRun& run);

}  // namespace diffnea
