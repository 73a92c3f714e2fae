#include <diffnea/core/error.hpp>
#include <diffnea/runs/audit_result.hpp>
#include <diffnea/io/sidecar.hpp>

#include "io/json.hpp"

namespace diffnea {
namespace {

io::Json number(double x) { return std::isfinite(x) ? io::Json(x) : io::Json(); }

}  // namespace

AuditReport audit_files(const std::vector<std::filesystem::path>& files, const AuditLimits& limits,
                        const std::vector<std::string>& passive) {
  if (files.empty()) throw DataError("audit: got no file, expected one or more");
  std::vector<Recording> recordings;
  ReadReport reading;
  for (const std::filesystem::path& file : files) {
    ReadOptions options;
    options.max_quarantined_share = 1.0;
    options.refuse_silent_torque = false;
    options.info.passive = passive;
    ReadReport one;
    for (Recording& r : read_recordings(file, with_sidecar(file, options), &one))
      recordings.push_back(std::move(r));
    reading.add(one);
  }
  if (recordings.empty())
    throw DataError(reading.source + ": there is no row that can be true; the first: line " +
                    std::to_string(reading.quarantined_rows.front().line) + ": " +
                    reading.quarantined_rows.front().reason);
  if (!limits.joints.empty() && recordings.front().num_joints() > 0)
    match_joints(limits.joints, recordings);
  AuditReport report = audit(recordings, limits);
  add_reading(reading, report);
  return report;
}

std::string audit_result_json(const AuditReport& report, const std::vector<std::string>& data,
                              const std::string& model) {
  io::Json faults = io::Json::array(), checks = io::Json::array(), periods = io::Json::array();
  for (const ChannelFault& f : report.faults)
    faults.push_back({{"fault", f.fault},
                      {"where", f.where},
                      {"channel", f.channel},
                      {"value", number(f.value)},
                      {"unit", f.unit},
                      {"std", number(f.std)},
                      {"significance", number(f.significance)},
                      {"severity", f.severity == FaultSeverity::kFault ? "fault" : "note"},
                      {"source", f.source.empty() ? io::Json() : io::Json(f.source)},
                      {"evidence", f.evidence}});
  for (const AuditCheck& c : report.checks)
    checks.push_back({{"check", c.name}, {"done", c.done}, {"text", c.text}});
  for (const Period& p : report.periods) {
    const bool periodic = p.seconds > 0.0;
    periods.push_back({{"seconds", periodic ? io::Json(p.seconds) : io::Json()},
                       {"std", periodic ? number(p.std) : io::Json()},
                       {"repeats", periodic ? number(p.repeats) : io::Json()},
                       {"mismatch", periodic ? number(p.mismatch) : io::Json()}});
  }
  const io::Json out = {{"schema", "diffnea/audit/1"},
                        {"data", data},
                        {"model", model.empty() ? io::Json() : io::Json(model)},
                        {"rows", report.rows},
                        {"rate_hz", report.rate_hz > 0.0 ? io::Json(report.rate_hz) : io::Json()},
                        {"audit", faults},
                        {"checks", checks},
                        {"periods", periods}};
  return out.dump(1, ' ', false, io::Json::error_handler_t::replace) + "\n";
}

}  // namespace diffnea
