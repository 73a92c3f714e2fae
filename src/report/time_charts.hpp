#pragma once
/// Torque over time, measured and by two models, with the errors below: charts that zoom where the
/// library is there, drawings otherwise.

#include <string>
#include <vector>

#include <diffnea/runs/result.hpp>

namespace diffnea::report {

/// What the two models are called, `nominal` and `fitted` of the series.
struct ChartNames {
  std::string before = "model before", after = "fitted";
  bool both_errors = false;  ///< what both models lack (measured − model), not the second's error
  bool one_model = false;    ///< there is no model before: the second one alone
};

/// Runs one after the other on one axis, thinned to `budget` points in all; gaps between them and
/// where rows are missing.
std::vector<TorqueSeries> on_one_axis(const std::vector<TorqueSeries>& in, std::size_t budget);

/// Columns of pixels for each of so many series, so that all drawings stay small.
int chart_columns(std::size_t num_series);

/// Attributes of the element that holds the charts.
/// @param set  of the page's data that they show: "test", "train"
std::string chart_set(const std::string& set, const ChartNames& names);
std::string chart_keys(const ChartNames& names);
/// @param all    as the page's data hold them
/// @param which  are drawn
/// @param what   is drawn: "torque"
std::string time_charts(const std::vector<TorqueSeries>& all, const std::vector<std::size_t>& which,
                        const std::string& what, int columns, const ChartNames& names);

}  // namespace diffnea::report
