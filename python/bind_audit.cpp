/// Faults of the channels of a recording.

#include <optional>

#include <pybind11/stl/filesystem.h>

#include <diffnea/identify/audit_limits.hpp>
#include <diffnea/identify/joint_choice.hpp>
#include <diffnea/report/audit_text.hpp>
#include <diffnea/runs/audit_result.hpp>

#include "bindings.hpp"
#include "recording_info.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

std::string name_of(const Model* model) { return model != nullptr ? model->name : ""; }

AuditLimits limits_of(const std::optional<Model>& model, double significance) {
  AuditLimits limits = model ? audit_limits(*model) : AuditLimits{};
  limits.significance = significance;
  return limits;
}

AuditRun audit_paths(const std::vector<std::filesystem::path>& files, const Model* model,
                     double significance, const std::vector<std::string>& passive) {
  std::vector<std::string> data;
  std::vector<ReadOptions> options;
  for (const std::filesystem::path& file : files) {
    data.push_back(file.string());
    options.emplace_back();
    options.back().info = described_info(file, std::nullopt, std::nullopt, passive, std::nullopt);
  }
  const std::optional<Model> served =
      model != nullptr ? std::optional(serve_joints(*model, files, options, {}).model)
                       : std::nullopt;
  return {audit_files(files, limits_of(served, significance), options), std::move(data),
          name_of(model)};
}

AuditRun audit_arrays(std::vector<Recording> recordings, const Model* model, double significance) {
  const std::optional<Model> served =
      model != nullptr ? std::optional(serve_joints(*model, recordings, {}).model) : std::nullopt;
  AuditLimits limits = limits_of(served, significance);
  if (model != nullptr) match_logged_joints(limits, recordings);
  std::vector<std::string> data;
  for (const Recording& r : recordings) data.push_back(r.source);
  return {audit(recordings, limits), std::move(data), name_of(model)};
}

}  // namespace

void bind_audit(py::module_& m) {
  value_type<ChannelFault>(m);
  value_type<AuditCheck>(m);
  value_type<Period>(m);
  auto c = value_type<AuditRun>(m, {.to_dict = true, .html = true});
  c.def(
       "to_dict", [](const AuditRun& x) { return parse_json(audit_result_json(x)); },
       "What ``diffnea audit --json`` prints, schema ``diffnea/audit/1``.")
      .def("__str__", [](const AuditRun& x) { return audit_text(x.report); })
      .def(
          "_repr_html_",
          [](const AuditRun& x) { return python_function("diffnea._results", "audit_html")(x); },
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
