#include "report/time_charts.hpp"

#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {

std::string chart_keys(const ChartNames& names) {
  return "<p class='faint'><span class='key measured'></span>measured"
         "<span class='key fitted'></span>" +
         escape(names.after) +
         (names.one_model ? "" : "<span class='key nominal'></span>" + escape(names.before)) +
         "; samples that were left out are gaps"
         "<span class='screen'>; drag to zoom, double-click to see all</span></p>\n";
}

std::string time_chart(const std::string& set, const std::string& joint, const char* part,
                       const ChartNames& names) {
  Data data{{"set", set}, {"joint", joint}, {"part", part}};
  data.insert(data.end(), {{"before", names.before}, {"after", names.after}});
  if (names.both_errors) data.emplace_back("both", "");
  if (names.one_model) data.emplace_back("one", "");
  return drawing("time", data, "chart") + "\n";
}

std::string time_charts(const std::string& set, const std::vector<ShownSeries>& all,
                        const std::vector<std::size_t>& which, const std::string& what,
                        const ChartNames& names) {
  const std::string below = names.one_model     ? ", and what the model lacks below ["
                            : names.both_errors ? ", and what both models lack below ["
                                                : ", and the fit's error below [";
  std::string out;
  for (const std::size_t j : which) {
    const std::string joint = std::to_string(j);
    if (!all[j].measured)
      out += "<h3>" + escape(all[j].joint) + " <small>not measured</small></h3>\n";
    else
      out += "<section class='joint'><h3>" + escape(all[j].joint) + " <small>" + what + below +
             escape(unit(all[j].unit)) + "]</small></h3>\n" +
             time_chart(set, joint, "value", names) + time_chart(set, joint, "error", names) +
             "</section>\n";
  }
  return out;
}

std::string open_and_folded(const std::string& set, const std::vector<ShownSeries>& all,
                            const std::vector<std::size_t>& open,
                            const std::vector<std::size_t>& folded, const std::string& what,
                            const ChartNames& names) {
  std::string out = chart_keys(names) + time_charts(set, all, open, what, names);
  if (folded.empty()) return out;
  return out + "<details><summary>The other " +
         (folded.size() == 1 ? "joint" : std::to_string(folded.size()) + " joints") +
         "</summary>\n" + time_charts(set, all, folded, what, names) + "</details>\n";
}

}  // namespace diffnea::report
