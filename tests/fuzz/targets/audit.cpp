#include <diffnea/report/audit_text.hpp>
#include <diffnea/runs/audit_result.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void audit(std::string_view input) {
  const InputFiles files(input, "data.csv", {"data.json", "test.csv", "test.json"});
  std::vector<std::filesystem::path> data{files["data.csv"]};
  if (std::filesystem::exists(files["test.csv"])) data.push_back(files["test.csv"]);
  result_or_error([&] {
    const AuditReport report = audit_files(data);
    audit_result_json({report, {"data.csv"}, ""});
    audit_text(report);
  });
}

}  // namespace diffnea::fuzz
