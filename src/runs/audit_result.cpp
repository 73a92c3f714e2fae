#include <diffnea/core/error.hpp>
#include <diffnea/identify/audit_limits.hpp>
#include <diffnea/io/sidecar.hpp>
#include <diffnea/runs/audit_result.hpp>

#include "core/constants.hpp"
#include "runs/fields_json.hpp"

namespace diffnea {
AuditReport audit_files(const std::vector<std::filesystem::path>& files, AuditLimits limits,
                        const std::vector<ReadOptions>& given) {
  if (files.empty()) throw DataError("audit: got no file, expected one or more");
  std::vector<Recording> recordings;
  ReadReport reading;
  for (std::size_t f = 0; f < files.size(); ++f) {
    ReadOptions options = given.empty() ? with_sidecar(files[f]) : given[f];
    options.max_quarantined_share = 1.0;
    options.refuse_silent_torque = false;
    ReadReport one;
    for (Recording& r : read_recordings(files[f], options, &one))
      recordings.push_back(std::move(r));
    reading.add(one);
  }
  if (recordings.empty())
    throw DataError(reading.source + ": there is no row that can be true; the first: line " +
                    std::to_string(reading.quarantined_rows.front().line) + ": " +
                    reading.quarantined_rows.front().reason);
  if (!limits.joints.empty() && recordings.front().num_joints() > 0)
    match_logged_joints(limits, recordings);
  AuditReport report = audit(recordings, limits);
  add_reading(reading, report);
  return report;
}

std::string audit_result_json(const AuditRun& run) {
  AuditRun shown = run;
  for (Period& p : shown.report.periods)
    if (!(p.seconds > 0.0)) p = {kNaN, kNaN, kNaN, kNaN};
  return io::file_text("diffnea/audit/1", shown, kInResult);
}

}  // namespace diffnea
