#pragma once
/// A diagnosis as one self-contained HTML page: no network, printable.

#include <string>

#include <diffnea/runs/diagnosis.hpp>

namespace diffnea {

/// The page, from what RUN/ holds (result.json and series.json) alone.
std::string diagnose_page(const DiagnoseRun& run);

}  // namespace diffnea
