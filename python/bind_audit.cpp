/// Faults of the channels of a recording.

#include <pybind11/stl/filesystem.h>

#include <diffnea/identify/source.hpp>
#include <diffnea/runs/audit_result.hpp>
#include <diffnea/report/audit_text.hpp>

#include "bindings.hpp"
#include "value_type.hpp"

namespace pybind11::detail {

/// "fault" or "note".
template <>
struct type_caster<diffnea::FaultSeverity> {
  PYBIND11_TYPE_CASTER(diffnea::FaultSeverity, const_name("str"));
  bool load(handle source, bool) {
    if (!isinstance<str>(source)) return false;
    value = source.cast<std::string>() == "fault" ? diffnea::FaultSeverity::kFault
                                                  : diffnea::FaultSeverity::kNote;
    return true;
  }
  static handle cast(diffnea::FaultSeverity severity, return_value_policy, handle) {
    return str(severity == diffnea::FaultSeverity::kFault ? "fault" : "note").release();
  }
};

}  // namespace pybind11::detail

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// A report with the names that its dictionary holds.
struct Audit {
  std::vector<ChannelFault> faults;
  std::vector<AuditCheck> checks;
  std::vector<Period> periods;
  long rows = 0;
  double rate_hz = 0.0;
  std::vector<std::string> data;
  std::string model;

  AuditReport report() const { return {faults, checks, periods, rows, rate_hz}; }
};

Audit named(AuditReport report, std::vector<std::string> data, const Model* model) {
  Audit out;
  out.faults = std::move(report.faults);
  out.checks = std::move(report.checks);
  out.periods = std::move(report.periods);
  out.rows = report.rows;
  out.rate_hz = report.rate_hz;
  out.data = std::move(data);
  if (model != nullptr) out.model = model->name;
  return out;
}

AuditLimits limits_of(const Model* model, double significance) {
  AuditLimits limits;
  if (model != nullptr) limits.joints = describe_joints(*model);
  limits.significance = significance;
  return limits;
}

Audit audit_paths(const std::vector<std::filesystem::path>& files, const Model* model,
                  double significance, const std::vector<std::string>& passive) {
  std::vector<std::string> data;
  for (const std::filesystem::path& file : files) data.push_back(file.string());
  return named(audit_files(files, limits_of(model, significance), passive), std::move(data), model);
}

Audit audit_arrays(std::vector<Recording> recordings, const Model* model, double significance) {
  const AuditLimits limits = limits_of(model, significance);
  if (model != nullptr) match_joints(limits.joints, recordings);
  std::vector<std::string> data;
  for (const Recording& r : recordings) data.push_back(r.source);
  return named(audit(recordings, limits), std::move(data), model);
}

}  // namespace

void bind_audit(py::module_& m) {
  value_type<ChannelFault>(
      m, "ChannelFault", "One thing that is wrong with a channel.",
      field("fault", &ChannelFault::fault, "Its name, e.g. ``velocity_filter_lag``."),
      field("where", &ChannelFault::where, "Joint, or ``time``, ``ball``, ``all``."),
      field("channel", &ChannelFault::channel, "Column, e.g. ``qd_elbow``."),
      field("value", &ChannelFault::value, "Size of the fault [``unit``]."),
      field("unit", &ChannelFault::unit, "Of the value; ``1`` for none."),
      field("std", &ChannelFault::std, "Standard error; NaN: a count or an exact value."),
      field("significance", &ChannelFault::significance,
            "Size over its standard error; NaN likewise."),
      field("severity", &ChannelFault::severity,
            "``fault``: biases what is fitted; ``note``: identification copes with it."),
      field("source", &ChannelFault::source, "Recording and run; empty: all of them together."),
      field("evidence", &ChannelFault::evidence, "One sentence with numbers."));
  value_type<AuditCheck>(m, "AuditCheck", "What was looked at, or why it could not be.",
                         field("name", &AuditCheck::name, "Of the family of checks."),
                         field("done", &AuditCheck::done, "Whether it could look."),
                         field("text", &AuditCheck::text, "What it looked at, or why not."));
  value_type<Period>(
      m, "Period", "How a motion repeats.",
      field("seconds", &Period::seconds, "The smallest period [s]; 0: none."),
      field("std", &Period::std, "Standard error of ``seconds`` [s]."),
      field("repeats", &Period::repeats, "How often the recording holds it."),
      field("mismatch", &Period::mismatch,
            "Rms difference of positions one period apart, over √2 times the motion's rms: "
            "1 if unrelated."));
  auto c = value_type<Audit>(
      m, "AuditReport", "Faults of the channels, and what was checked.",
      field("faults", &Audit::faults, "Faults first, then notes; each by its significance."),
      field("checks", &Audit::checks, "What was looked at."),
      field("periods", &Audit::periods, "Per recording."),
      field("rows", &Audit::rows, "Of all recordings."),
      field("rate_hz", &Audit::rate_hz, "Of the rows [Hz]; 0: unknown."),
      field("data", &Audit::data, "The recordings, as they were named."),
      field("model", &Audit::model, "The model's name; empty: none was given."));
  c.def(
       "to_dict",
       [](const Audit& x) { return parse_json(audit_result_json(x.report(), x.data, x.model)); },
       "What ``diffnea audit --json`` prints, schema ``diffnea/audit/1``.")
      .def("__str__", [](const Audit& x) { return audit_text(x.report()); })
      .def(
          "_repr_html_",
          [](const Audit& x) { return python_function("diffnea._results", "audit_html")(x); },
          "A small table for notebooks.");
  def_to_frame(c, "The faults as a pandas data frame, a row a fault.");
  m.def("_audit_files", &audit_paths, "files"_a, "model"_a.none(true), "significance"_a,
        "passive"_a, py::call_guard<py::gil_scoped_release>());
  m.def("_audit_recordings", &audit_arrays, "recordings"_a, "model"_a.none(true), "significance"_a,
        py::call_guard<py::gil_scoped_release>());
  m.def("detect_period", &detect_period, "recording"_a, py::call_guard<py::gil_scoped_release>(),
        "The smallest period of the positions' motion; two periods at least must lie in the\n"
        "recording's longest stretch without a gap.");
}

}  // namespace diffnea::python
