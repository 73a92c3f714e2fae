#pragma once
/// Places of charts over time: measured and by two models, with the errors below.

#include <string>
#include <vector>

namespace diffnea::report {

/// Names of the two models.
struct ChartNames {
  std::string before = "model before", after = "fitted";
  bool both_errors = false;  ///< what both models lack (measured − model), not the second's error
  bool one_model = false;    ///< there is no model before: the second one alone
};

/// A series of the page's data.
struct ShownSeries {
  std::string joint, unit;
  bool measured = true;
};
template <class Series>
std::vector<ShownSeries> shown(const std::vector<Series>& list) {
  std::vector<ShownSeries> out;
  for (const Series& s : list) out.push_back({s.joint, s.unit, !s.time.empty()});
  return out;
}

/// Colours and names of the lines.
std::string chart_keys(const ChartNames& names);
/// One chart. @param set, joint  of the page's data: "test" and 0  @param part  "value" or "error"
std::string time_chart(const std::string& set, const std::string& joint, const char* part,
                       const ChartNames& names);
/// Two charts for each of some series.
/// @param which  are shown  @param what  is drawn: "torque"
std::string time_charts(const std::string& set, const std::vector<ShownSeries>& all,
                        const std::vector<std::size_t>& which, const std::string& what,
                        const ChartNames& names);
/// Some open, with the lines' names, the others folded.
std::string open_and_folded(const std::string& set, const std::vector<ShownSeries>& all,
                            const std::vector<std::size_t>& open,
                            const std::vector<std::size_t>& folded, const std::string& what,
                            const ChartNames& names);

}  // namespace diffnea::report
