#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/result.hpp>

#include "core/constants.hpp"
#include "io/sha256.hpp"
#include "runs/ball_json.hpp"
#include "runs/fields_json.hpp"
#include "runs/printed.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::JsonObject;
using io::number;

constexpr const char* kIdentifySchema = "diffnea/identify/1";
constexpr const char* kIdentifySeriesSchema = "diffnea/series/1";

/// Errors by joint: a key of `rmse` each.
constexpr std::pair<const char*, double JointError::*> kErrors[] = {
    {"train", &JointError::train},
    {"nominal_train", &JointError::nominal_train},
    {"test", &JointError::test},
    {"nominal_test", &JointError::nominal_test},
    {"test_all", &JointError::test_all},
    {"test_raw", &JointError::test_raw},
    {"torque_rms", &JointError::torque_rms}};

/// The effects of the fitted model; what was estimated with its standard error.
Json effects(const IdentifyResult& fit) {
  std::map<std::string, double> std_of;
  for (const ParameterEstimate& p : fit.parameters)
    if (p.identifiable) std_of[p.name] = p.std;
  Json out = Json::array();
  for (const EffectSpec& e : fit.model.effects) {
    Json list = Json::array();
    for (const EffectParameter& p : e.parameters) {
      const auto known = std_of.find(e.where + "." + e.effect + "." + p.name);
      list.push_back({{"name", p.name},
                      {"value", number(p.value)},
                      {"unit", p.unit},
                      {"std", known == std_of.end() ? Json() : number(known->second)}});
    }
    out.push_back({{"effect", e.effect}, {"where", e.where}, {"parameters", list}});
  }
  return out;
}

/// Columns are of the layout; files name the parameters.
Json base_parameters(const IdentifyResult& fit) {
  Json out = Json::array();
  for (const BaseParameter& b : fit.base_parameters) {
    Json terms = Json::array();
    for (std::size_t k = 0; k < b.columns.size(); ++k)
      terms.push_back({{"parameter", fit.parameters[b.columns[k]].name},
                       {"coefficient", number(b.coefficients[k])}});
    out.push_back(io::fields_json(b, kInResult));
    out.back()["terms"] = terms;
  }
  return out;
}

void read_base_parameters(JsonObject& root, IdentifyResult& fit) {
  std::map<std::string, int> index;
  for (std::size_t k = 0; k < fit.parameters.size(); ++k)
    index[fit.parameters[k].name] = static_cast<int>(k);
  io::for_each_object(root, "base_parameters", [&](JsonObject& o) {
    BaseParameter b;
    io::read_fields(b, o, kInResult);
    io::for_each_object(o, "terms", [&](JsonObject& term) {
      const auto found = index.find(term.string("parameter"));
      if (found == index.end())
        throw ModelError(term.at("parameter") + ": '" + term.string("parameter") +
                         "' is not among the parameters");
      b.columns.push_back(found->second);
      b.coefficients.push_back(io::number_or_nan(term, "coefficient"));
    });
    fit.base_parameters.push_back(b);
  });
}

Json errors(const IdentifyResult& fit) {
  Json units = Json::object(), fitted = Json::object(), nominal = Json::object();
  bool held_out = false;
  for (const JointError& e : fit.errors) held_out = held_out || std::isfinite(e.test);
  for (const JointError& e : fit.errors) {
    units[e.joint] = e.unit;
    fitted[e.joint] = number((held_out ? e.test : e.train) / e.torque_rms);
    nominal[e.joint] = number((held_out ? e.nominal_test : e.nominal_train) / e.torque_rms);
  }
  Json out{{"units", units}};
  for (const auto& [key, member] : kErrors) {
    Json& by_joint = out[key] = Json::object();
    for (const JointError& e : fit.errors) by_joint[e.joint] = number(e.*member);
  }
  out["relative"] = {{"of", held_out ? "test" : "train"}, {"fitted", fitted}, {"nominal", nominal}};
  return out;
}

void read_errors(JsonObject& root, IdentifyResult& fit) {
  JsonObject rmse(root.required("rmse"), root.at("rmse"));
  const Json& units = rmse.required("units");
  if (!units.is_object()) throw ModelError(rmse.at("units") + ": expected an object");
  for (const auto& item : units.items()) {
    JointError e;
    e.joint = item.key();
    e.unit = io::json_string(item.value(), rmse.at("units"));
    for (const auto& [key, member] : kErrors) {
      e.*member = kNaN;
      if (const Json* table = rmse.optional(key)) {
        JsonObject object(*table, rmse.at(key));
        e.*member = io::number_or_nan(object, e.joint.c_str());
      }
    }
    fit.errors.push_back(e);
  }
}

}  // namespace

static Json custom_json(const IdentifyResult& fit, std::string_view key, RunFile) {
  return key == "effects"           ? effects(fit)
         : key == "base_parameters" ? base_parameters(fit)
         : key == "rmse"            ? errors(fit)
                                    : io::ball_columns(fit.ball);
}

static void read_custom(IdentifyResult& fit, std::string_view key, JsonObject& root, RunFile) {
  if (key == "base_parameters")
    read_base_parameters(root, fit);
  else if (key == "rmse")
    read_errors(root, fit);
  else if (key == "ball")
    io::read_ball_columns(root, fit.ball);
}

namespace {

constexpr std::uintmax_t kLargestHashed = std::uintmax_t{64} << 20;  // a third of a second

/// A bag or a data set: bytes of all files; the hash is of their names and hashes, in order.
void describe_folder(const std::filesystem::path& folder, RunInput& out) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(entry.path());
  std::ranges::sort(files);
  for (const std::filesystem::path& file : files) out.bytes += std::filesystem::file_size(file);
  if (out.bytes > kLargestHashed) return;
  std::string list;
  for (const std::filesystem::path& file : files)
    list +=
        file.lexically_relative(folder).string() + "\n" + io::sha256(read_text_file(file)) + "\n";
  out.sha256 = io::sha256(list);
}

}  // namespace

RunInput describe_input(const std::string& role, const std::filesystem::path& path) {
  RunInput out;
  out.role = role;
  out.path = path.string();
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    describe_folder(path, out);
    return out;
  }
  out.bytes = std::filesystem::file_size(path, error);
  if (error) throw FileError(path.string() + ": cannot be read (" + error.message() + ")");
  if (out.bytes <= kLargestHashed) out.sha256 = io::sha256(read_text_file(path));
  return out;
}

std::string identify_result_json(const FitRun& run) {
  return io::file_text(kIdentifySchema, run, kInResult);
}

std::string series_json(const IdentifyResult& fit) {
  return io::file_text(kIdentifySeriesSchema, fit, kInSeries);
}

FitRun read_fit_run(const std::filesystem::path& folder) {
  FitRun run;
  io::read_file(run, folder, kIdentifySchema, kInResult);
  if (std::filesystem::exists(folder / "series.json"))
    io::read_file(run.fit, folder, kIdentifySeriesSchema, kInSeries);
  if (const auto path = folder / "model.json"; std::filesystem::exists(path))
    run.fit.model.posterior = read_model(path).posterior;
  return run;
}

std::string comparison_json(const Comparison& comparison) {
  return io::file_text("diffnea/compare/1", comparison, kInResult);
}

std::string report_result_json(const std::filesystem::path& page) {
  return io::file_text("diffnea/report/1", ReportedFile{page.string()}, kInResult);
}

}  // namespace diffnea
