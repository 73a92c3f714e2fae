#include <cstring>

#include <diffnea/core/error.hpp>
#include <diffnea/runs/audit_result.hpp>
#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/schemas.hpp>

#include "runs/fields_schema.hpp"
#include "runs/policy_rows.hpp"
#include "runs/printed.hpp"

namespace diffnea {
namespace {

using io::Json;

struct File {
  const char* name;   ///< NAME of "diffnea/NAME/1"
  const char* title;  ///< where it is from
  std::string (*schema)(const std::string& schema, const char* title);
};

template <class T, RunFile file>
std::string schema_of_file(const std::string& schema, const char* title) {
  return io::file_schema<T>(schema, title, file);
}

constexpr File kFiles[] = {
    {"audit", "What diffnea audit --json prints", schema_of_file<AuditRun, kInResult>},
    {"compare", "What diffnea compare --json prints", schema_of_file<Comparison, kInResult>},
    {"diagnose", "result.json of diffnea diagnose", schema_of_file<DiagnoseRun, kInResult>},
    {"diagnose-series", "series.json of diffnea diagnose", schema_of_file<Finding, kInSeries>},
    {"excite", "What diffnea excite --json prints", schema_of_file<ExcitedFile, kInResult>},
    {"export", "What diffnea export --json prints", schema_of_file<ExportedFile, kInResult>},
    {"identify", "result.json of diffnea identify", schema_of_file<FitRun, kInResult>},
    {"learn", "result.json of diffnea learn", schema_of_file<LearnFile, kInResult>},
    {"policy", "policy_<seed>.json", schema_of_file<LearnedPolicy, kInResult>},
    {"report", "What diffnea report --json prints", schema_of_file<ReportedFile, kInResult>},
    {"series", "series.json of diffnea identify", schema_of_file<IdentifyResult, kInSeries>},
    {"simulate", "What diffnea simulate --json prints", schema_of_file<SimulatedFile, kInResult>},
    {"transfer", "result.json of diffnea transfer", schema_of_file<TransferFile, kInResult>},
};

const Json kNumber{{"type", {"number", "null"}}};
const Json kText{{"type", "string"}};

Json object(const Json& properties) {
  Json required = Json::array();
  for (const auto& item : properties.items()) required.push_back(item.key());
  return {{"type", "object"}, {"required", required}, {"properties", properties}};
}

Json list(const Json& items) { return {{"type", "array"}, {"items", items}}; }

Json by_joint(const Json& value) { return {{"type", "object"}, {"additionalProperties", value}}; }

Json or_null(Json schema) { return {{"anyOf", {std::move(schema), {{"type", "null"}}}}}; }

/// Path of a ball in series.json.
Json path() {
  Json column = list(kNumber);
  column["maxItems"] = 4000;
  const Json points = object({{"x", column}, {"y", column}, {"z", column}});
  return or_null(object({{"run", list({{"type", "integer"}})},
                         {"window", list({{"type", "integer"}})},
                         {"time", column},
                         {"measured", points},
                         {"base", points},
                         {"extended", points},
                         {"anchor", or_null(points)},
                         {"taut", or_null(list({{"type", "boolean"}}))}}));
}

}  // namespace

static Json custom_schema(const Finding*, std::string_view, RunFile) { return path(); }

static Json custom_schema(const IdentifyResult*, std::string_view key, RunFile) {
  if (key == "effects")
    return list(
        object({{"effect", kText},
                {"where", kText},
                {"parameters",
                 list(object(
                     {{"name", kText}, {"value", kNumber}, {"unit", kText}, {"std", kNumber}}))}}));
  if (key == "base_parameters")
    return list(
        object({{"expression", kText},
                {"value", kNumber},
                {"std", kNumber},
                {"terms", list(object({{"parameter", kText}, {"coefficient", kNumber}}))}}));
  if (key == "ball") return path();
  const Json numbers = by_joint(kNumber);
  return object({{"units", by_joint(kText)},
                 {"train", numbers},
                 {"nominal_train", numbers},
                 {"test", numbers},
                 {"nominal_test", numbers},
                 {"test_all", numbers},
                 {"test_raw", numbers},
                 {"torque_rms", numbers},
                 {"relative", object({{"of", {{"enum", {"test", "train"}}}},
                                      {"fitted", numbers},
                                      {"nominal", numbers}})}});
}

std::vector<std::string> schema_names() {
  std::vector<std::string> out;
  for (const File& file : kFiles) out.emplace_back(file.name);
  return out;
}

std::string json_schema(const std::string& name) {
  std::string choices;
  for (const File& file : kFiles) {
    if (name == file.name) return file.schema("diffnea/" + name + "/1", file.title);
    choices += (choices.empty() ? "" : ", ") + std::string(file.name);
  }
  throw Error("json_schema: got '" + name + "'; choices: " + choices);
}

}  // namespace diffnea
