#pragma once
/// A diagnosis' simulated motion: charts over time and errors before and after.

#include <string>
#include <vector>

#include <diffnea/runs/diagnosis.hpp>

namespace diffnea::report {

/// Positions in place of torques; windows side by side, however far apart they were recorded.
std::vector<TorqueSeries> simulated_series(const SimulatedMotion& m);

/// One sentence: by how much the simulated motion came closer; empty if there is none.
std::string simulated_gain(const Finding& f);

/// @param drawn  simulated_series(), which the page's data hold as set `set`
std::string simulated_charts(const Finding& f, const std::vector<TorqueSeries>& drawn,
                             const std::string& set);

}  // namespace diffnea::report
