#include "report/fit_words.hpp"

#include <algorithm>
#include <cmath>

#include "report/format.hpp"

namespace diffnea::report {

bool has_test(const IdentifyResult& fit) {
  return std::ranges::any_of(fit.errors, [](const JointError& e) { return std::isfinite(e.test); });
}

bool is_ball(const JointError& error) { return error.joint == "ball" && error.unit == "m"; }

std::pair<double, std::string> shown_unit(const JointError& error) {
  return is_ball(error) ? std::pair<double, std::string>{1e3, "mm"}
                        : std::pair<double, std::string>{1.0, unit(error.unit)};
}

std::string quantity(const IdentifyResult& fit) {
  return std::ranges::any_of(fit.errors,
                             [](const JointError& e) { return e.unit.starts_with('N'); })
             ? "torque"
             : "position";
}

double before(const IdentifyResult& fit, const JointError& error) {
  return has_test(fit) ? error.nominal_test : error.nominal_train;
}

double after(const IdentifyResult& fit, const JointError& error) {
  return has_test(fit) ? error.test : error.train;
}

std::string rows_text(const IdentifyResult& fit) {
  const long quarantined = fit.data_report.quarantined;
  return std::to_string(fit.summary.rows + quarantined) + " recorded rows" +
         (quarantined > 0 ? " (" + std::to_string(quarantined) + " quarantined)" : "") + ", " +
         std::to_string(fit.summary.fitted_rows) + " " + quantity(fit) + " samples fitted";
}

std::vector<std::string> notes(const IdentifyResult& fit) {
  std::vector<std::string> out = fit.notes;
  std::vector<std::string> texts, files;
  std::vector<int> counts;
  for (const std::string& note : fit.data_report.notes) {
    const std::size_t colon = note.find(": ");
    const std::string text = colon == std::string::npos ? note : note.substr(colon);
    const auto known = std::ranges::find(texts, text);
    if (known != texts.end()) {
      ++counts[static_cast<std::size_t>(known - texts.begin())];
      continue;
    }
    texts.push_back(text);
    files.push_back(colon == std::string::npos ? "" : note.substr(0, colon));
    counts.push_back(1);
  }
  for (std::size_t k = 0; k < texts.size(); ++k)
    out.push_back(files[k] +
                  (counts[k] > 1 ? " and " + std::to_string(counts[k] - 1) + " more" : "") +
                  texts[k]);
  return out;
}

}  // namespace diffnea::report
