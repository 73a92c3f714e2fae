#include <limits>
#include <map>

#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/result.hpp>

#include "runs/ball_json.hpp"
#include "runs/run_reader.hpp"

namespace diffnea {
namespace {

using io::count;
using io::for_each_object;
using io::Json;
using io::JsonObject;
using io::number_or_nan;
using io::read_reproduce;
using io::require_schema;
using io::strings;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void read_parameters(JsonObject& root, IdentifyResult& fit) {
  std::map<std::string, int> index;
  for_each_object(root, "parameters", [&](JsonObject& o) {
    ParameterEstimate p;
    p.name = o.string("name");
    p.unit = o.string("unit");
    p.value = number_or_nan(o, "value");
    p.std = number_or_nan(o, "std");
    p.prior = number_or_nan(o, "prior");
    p.identifiable = o.boolean_or("identifiable", false);
    p.fixed = o.boolean_or("fixed", false);
    p.at_bound = o.boolean_or("at_bound", false);
    index[p.name] = static_cast<int>(fit.parameters.size());
    fit.parameters.push_back(p);
  });
  for_each_object(root, "base_parameters", [&](JsonObject& o) {
    BaseParameter b;
    b.expression = o.string("expression");
    b.value = number_or_nan(o, "value");
    b.std = number_or_nan(o, "std");
    for_each_object(o, "terms", [&](JsonObject& term) {
      const auto found = index.find(term.string("parameter"));
      if (found == index.end())
        throw ModelError(term.at("parameter") + ": '" + term.string("parameter") +
                         "' is not among the parameters");
      b.columns.push_back(found->second);
      b.coefficients.push_back(number_or_nan(term, "coefficient"));
    });
    fit.base_parameters.push_back(b);
  });
}

void read_torque_constants(JsonObject& root, IdentifyResult& fit) {
  if (!root.optional("torque_constants")) return;
  for_each_object(root, "torque_constants", [&](JsonObject& o) {
    fit.torque_constants.push_back({o.string("joint"), o.string("unit"),
                                    number_or_nan(o, "assumed"), number_or_nan(o, "value"),
                                    number_or_nan(o, "std")});
  });
}

void read_errors(JsonObject& root, IdentifyResult& fit) {
  JsonObject rmse(root.required("rmse"), root.at("rmse"));
  const Json& units = rmse.required("units");
  if (!units.is_object()) throw ModelError(rmse.at("units") + ": expected an object");
  const auto value = [&](const char* key, const std::string& joint) {
    const Json* table = rmse.optional(key);
    if (!table) return kNaN;
    JsonObject object(*table, rmse.at(key));
    return number_or_nan(object, joint.c_str());
  };
  for (const auto& item : units.items()) {
    JointError e;
    e.joint = item.key();
    e.unit = io::json_string(item.value(), rmse.at("units"));
    e.train = value("train", e.joint);
    e.nominal_train = value("nominal_train", e.joint);
    e.test = value("test", e.joint);
    e.nominal_test = value("nominal_test", e.joint);
    e.test_all = value("test_all", e.joint);
    e.test_raw = value("test_raw", e.joint);
    e.torque_rms = value("torque_rms", e.joint);
    fit.errors.push_back(e);
  }
}

void read_preprocessing(JsonObject& root, IdentifyResult& fit) {
  JsonObject p(root.required("preprocessing"), root.at("preprocessing"));
  fit.plan.filter_hz = number_or_nan(p, "filter_hz");
  fit.plan.decimator.rate_hz = number_or_nan(p, "decimated_to_hz");
  fit.plan.decimator.factor = 1;
  fit.plan.dt = number_or_nan(p, "period");
  fit.plan.timing_jitter = number_or_nan(p, "timing_jitter");
  fit.summary.rows = count(p, "rows");
  fit.summary.fitted_rows = count(p, "fitted_rows");
  fit.data_report.quarantined = count(p, "quarantined");
  fit.data_report.extra_channels = strings(p, "extra_channels");
  fit.data_report.notes = strings(p, "notes");
  for_each_object(p, "quarantined_rows", [&](JsonObject& o) {
    fit.data_report.quarantined_rows.push_back({count(o, "line"), o.string_or("reason", "")});
  });
}

void read_summary(JsonObject& root, FitSummary& out) {
  JsonObject s(root.required("summary"), root.at("summary"));
  out.converged = s.boolean_or("converged", false);
  out.interrupted = s.boolean_or("interrupted", false);
  out.termination = s.string_or("termination", "");
  out.iterations = static_cast<int>(count(s, "iterations"));
  out.passes = static_cast<int>(count(s, "passes"));
  out.seconds = number_or_nan(s, "seconds");
  out.seconds_fitting = number_or_nan(s, "seconds_fitting");
}

std::vector<TorqueSeries> read_series(JsonObject& root, const char* key) {
  std::vector<TorqueSeries> out;
  for_each_object(root, key, [&](JsonObject& o) {
    TorqueSeries s;
    s.joint = o.string("joint");
    s.unit = o.string("unit");
    s.time = io::column(o, "time");
    s.measured = io::column(o, "measured");
    s.fitted = io::column(o, "fitted");
    s.nominal = io::column(o, "nominal");
    if (o.optional("velocity")) s.velocity = io::column(o, "velocity");
    if (!s.velocity.empty() && s.velocity.size() != s.time.size())
      throw ModelError(o.at("velocity") + ": has " + std::to_string(s.velocity.size()) +
                       " values, time " + std::to_string(s.time.size()));
    for (const std::vector<double>* column : {&s.measured, &s.fitted, &s.nominal})
      if (column->size() != s.time.size())
        throw ModelError(o.at("time") + ": has " + std::to_string(s.time.size()) +
                         " values, another column " + std::to_string(column->size()));
    out.push_back(std::move(s));
  });
  return out;
}

}  // namespace

FitRun read_fit_run(const std::filesystem::path& folder) {
  FitRun run;
  const std::string where = (folder / "result.json").string();
  const Json document = io::run_file(folder, "result.json");
  JsonObject root(document, where);
  require_schema(root, where, "diffnea/identify/1");
  IdentifyResult& fit = run.fit;
  fit.model.name = root.string_or("model", "");
  fit.physically_consistent = root.boolean_or("physically_consistent", false);
  fit.consistency_cost = number_or_nan(root, "consistency_cost");
  fit.boundary = strings(root, "boundary");
  fit.notes = strings(root, "notes");
  read_parameters(root, fit);
  read_torque_constants(root, fit);
  read_errors(root, fit);
  fit.ball = io::read_ball_summary(root);
  read_preprocessing(root, fit);
  read_summary(root, fit.summary);
  read_reproduce(root, run.reproduce);
  if (const auto path = folder / "series.json"; std::filesystem::exists(path)) {
    const Json json = io::run_file(folder, "series.json");
    JsonObject object(json, path.string());
    require_schema(object, path.string(), "diffnea/series/1");
    fit.train_series = read_series(object, "train");
    fit.test_series = read_series(object, "test");
    io::read_ball_columns(object, fit.ball);
  }
  if (const auto path = folder / "model.json"; std::filesystem::exists(path))
    fit.model.posterior = read_model(path).posterior;
  return run;
}

}  // namespace diffnea
