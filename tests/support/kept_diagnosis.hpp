#pragma once
/// What a folder of results makes of a finding.

#include <string>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/text_file.hpp>
#include <diffnea/report/diagnose_page.hpp>
#include <diffnea/report/run_folder.hpp>

#include "support/temporary_folder.hpp"

namespace diffnea::test {

/// Writes it as `diagnose` does and reads it again, which must hold all that was written.
/// @return the page
inline std::string kept_page(const Finding& finding) {
  const TemporaryFolder home;
  DiagnoseRun run{finding, {"1.2.3", {"diffnea", "diagnose"}, {}}};
  ResultFolder folder(home.path() / "run");
  publish_diagnose_run(run, folder);
  const DiagnoseRun kept = read_diagnose_run(folder.path());
  CHECK(diagnose_result_json(kept) == read_text_file(folder.path() / "result.json"));
  CHECK(diagnose_series_json(kept.finding) == read_text_file(folder.path() / "series.json"));
  CHECK(read_text_file(folder.path() / "report.html") == diagnose_page(kept));
  return diagnose_page(kept);
}

}  // namespace diffnea::test
