#include <cmath>
#include <map>

#include <diffnea/core/text_file.hpp>
#include <diffnea/runs/result.hpp>

#include "runs/ball_json.hpp"
#include "runs/json_numbers.hpp"
#include "io/sha256.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::number;
using io::reproduce;
using io::rounded;
using io::text;

Json parameters(const IdentifyResult& fit) {
  Json out = Json::array();
  for (const ParameterEstimate& p : fit.parameters)
    out.push_back({{"name", p.name},
                   {"value", number(p.value)},
                   {"unit", p.unit},
                   {"std", number(p.std)},
                   {"prior", number(p.prior)},
                   {"identifiable", p.identifiable},
                   {"fixed", p.fixed},
                   {"at_bound", p.at_bound}});
  return out;
}

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

Json base_parameters(const IdentifyResult& fit) {
  Json out = Json::array();
  for (const BaseParameter& b : fit.base_parameters) {
    Json terms = Json::array();
    for (std::size_t k = 0; k < b.columns.size(); ++k)
      terms.push_back({{"parameter", fit.parameters[b.columns[k]].name},
                       {"coefficient", number(b.coefficients[k])}});
    out.push_back({{"expression", b.expression},
                   {"value", number(b.value)},
                   {"std", number(b.std)},
                   {"terms", terms}});
  }
  return out;
}

Json by_joint(const IdentifyResult& fit, double JointError::* member) {
  Json out = Json::object();
  for (const JointError& e : fit.errors) out[e.joint] = number(e.*member);
  return out;
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
  return {{"units", units},
          {"train", by_joint(fit, &JointError::train)},
          {"nominal_train", by_joint(fit, &JointError::nominal_train)},
          {"test", by_joint(fit, &JointError::test)},
          {"nominal_test", by_joint(fit, &JointError::nominal_test)},
          {"test_all", by_joint(fit, &JointError::test_all)},
          {"test_raw", by_joint(fit, &JointError::test_raw)},
          {"torque_rms", by_joint(fit, &JointError::torque_rms)},
          {"relative",
           {{"of", held_out ? "test" : "train"}, {"fitted", fitted}, {"nominal", nominal}}}};
}

Json torque_constants(const IdentifyResult& fit) {
  Json out = Json::array();
  for (const TorqueConstant& k : fit.torque_constants)
    out.push_back({{"joint", k.joint},
                   {"unit", k.unit},
                   {"assumed", number(k.assumed)},
                   {"value", number(k.value)},
                   {"std", number(k.std)}});
  return out;
}

Json preprocessing(const IdentifyResult& fit) {
  const PreprocessPlan& plan = fit.plan;
  Json quarantined = Json::array();
  for (const QuarantinedRow& row : fit.data_report.quarantined_rows)
    quarantined.push_back({{"line", row.line}, {"reason", row.reason}});
  return {{"filter_hz", number(plan.filter_hz)},
          {"decimated_to_hz", number(plan.decimator.rate_hz / plan.decimator.factor)},
          {"period", number(plan.dt)},
          {"rows", fit.summary.rows},
          {"fitted_rows", fit.summary.fitted_rows},
          {"quarantined", fit.data_report.quarantined},
          {"quarantined_rows", quarantined},
          {"extra_channels", fit.data_report.extra_channels},
          {"notes", fit.data_report.notes},
          {"timing_jitter", number(plan.timing_jitter)}};
}

Json series(const std::vector<TorqueSeries>& list) {
  Json out = Json::array();
  for (const TorqueSeries& s : list)
    out.push_back({{"joint", s.joint},
                   {"unit", s.unit},
                   {"time", rounded(s.time)},
                   {"measured", rounded(s.measured)},
                   {"fitted", rounded(s.fitted)},
                   {"nominal", rounded(s.nominal)},
                   {"velocity", rounded(s.velocity)}});
  return out;
}

}  // namespace

RunInput describe_input(const std::string& role, const std::filesystem::path& path) {
  constexpr std::uintmax_t kLargestHashed = std::uintmax_t{64} << 20;  // a third of a second
  RunInput out;
  out.role = role;
  out.path = path.string();
  std::error_code error;
  out.bytes = std::filesystem::file_size(path, error);
  if (error) throw FileError(path.string() + ": cannot be read (" + error.message() + ")");
  if (out.bytes <= kLargestHashed) out.sha256 = io::sha256(read_text_file(path));
  return out;
}

std::string identify_result_json(const FitRun& run) {
  const IdentifyResult& fit = run.fit;
  const FitSummary& s = fit.summary;
  return text({{"schema", "diffnea/identify/1"},
               {"model", fit.model.name},
               {"physically_consistent", fit.physically_consistent},
               {"parameters", parameters(fit)},
               {"effects", effects(fit)},
               {"rank", fit.base_parameters.size()},
               {"base_parameters", base_parameters(fit)},
               {"torque_constants", torque_constants(fit)},
               {"rmse", errors(fit)},
               {"ball", io::ball_summary(fit.ball)},
               {"boundary", fit.boundary},
               {"consistency_cost", number(fit.consistency_cost)},
               {"preprocessing", preprocessing(fit)},
               {"notes", fit.notes},
               {"summary",
                {{"converged", s.converged},
                 {"interrupted", s.interrupted},
                 {"termination", s.termination},
                 {"iterations", s.iterations},
                 {"passes", s.passes},
                 {"seconds", number(s.seconds)},
                 {"seconds_fitting", number(s.seconds_fitting)}}},
               {"reproduce", reproduce(run.reproduce)}},
              1);
}

std::string series_json(const IdentifyResult& fit) {
  return text({{"schema", "diffnea/series/1"},
               {"model", fit.model.name},
               {"train", series(fit.train_series)},
               {"test", series(fit.test_series)},
               {"ball", io::ball_columns(fit.ball)}},
              -1);
}

std::string comparison_json(const Comparison& c) {
  const auto list = [](const std::vector<Change>& changes) {
    Json out = Json::array();
    for (const Change& change : changes)
      out.push_back({{"name", change.name},
                     {"unit", change.unit},
                     {"before", number(change.before)},
                     {"after", number(change.after)},
                     {"std", number(change.std)},
                     {"z", number(change.z)},
                     {"p", number(change.p)},
                     {"significant", change.significant}});
    return out;
  };
  Json left_over = Json::array();
  for (const LeftOver& left : c.left_over)
    left_over.push_back({{"joint", left.joint},
                         {"unit", left.unit},
                         {"before", number(left.before)},
                         {"after", number(left.after)}});
  return text({{"schema", "diffnea/compare/1"},
               {"joints", c.joints},
               {"changed", c.changed},
               {"base_parameters", list(c.base_parameters)},
               {"parameters", list(c.parameters)},
               {"left_over", left_over},
               {"std_ratio", number(c.std_ratio)},
               {"only_before", c.only_before},
               {"only_after", c.only_after},
               {"not_comparable", c.not_comparable}},
              1);
}

std::string report_result_json(const std::filesystem::path& page) {
  return text({{"schema", "diffnea/report/1"}, {"page", page.string()}}, 1);
}

}  // namespace diffnea
