#pragma once
/// A fit as one self-contained HTML page: no network, printable.

#include <string>

#include <diffnea/runs/result.hpp>

namespace diffnea {

/// The page, from what RUN/ holds (result.json and series.json) alone.
std::string identify_page(const FitRun& run);

}  // namespace diffnea
