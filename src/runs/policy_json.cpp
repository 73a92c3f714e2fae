#include "runs/policy_json.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "runs/json_numbers.hpp"
#include "runs/run_reader.hpp"

namespace diffnea::io {
namespace {

constexpr std::array<std::pair<const char*, double ErepsIteration::*>, 9> kColumns{
    {{"reward_mean", &ErepsIteration::reward_mean},
     {"reward_best", &ErepsIteration::reward_best},
     {"eta", &ErepsIteration::eta},
     {"kl_samples", &ErepsIteration::kl_samples},
     {"kl_update", &ErepsIteration::kl_update},
     {"entropy", &ErepsIteration::entropy},
     {"effective_samples", &ErepsIteration::effective_samples},
     {"largest_std", &ErepsIteration::largest_std},
     {"solved_share", &ErepsIteration::solved_share}}};

/// A covariance of as many rows is factorised in seconds; a search with a tenth of them is a large
/// one.
constexpr long kMostParameters = 1500;

constexpr const char* kPd = "pd";
constexpr const char* kComputedTorque = "computed_torque";

bool read_boolean(JsonObject& o, const char* key) {
  o.required(key);
  return o.boolean_or(key, false);
}

int read_int(JsonObject& o, const char* key) {
  const long x = read_integer(o, key);
  if (x != static_cast<int>(x))
    throw ModelError(o.at(key) + ": got " + std::to_string(x) + ", which is too large");
  return static_cast<int>(x);
}

double number_between(JsonObject& o, const char* key, double low, double high) {
  const double x = o.number(key);
  if (!(x >= low && x <= high))
    throw ModelError(o.at(key) + ": got " + Json(x).dump() + ", expected " + Json(low).dump() +
                     " to " + Json(high).dump());
  return x;
}

void require_length(std::size_t got, long expected, const std::string& where, const char* what) {
  if (static_cast<long>(got) != expected)
    throw ModelError(where + ": got " + std::to_string(got) + " numbers, expected " +
                     std::to_string(expected) + " (one per " + what + ")");
}

}  // namespace

Json values(const VecX<double>& x) {
  Json out = Json::array();
  for (const double v : x) out.push_back(v);
  return out;
}

Json gaussian(const Gaussian& g) {
  Json rows = Json::array();
  for (long i = 0; i < g.covariance.rows(); ++i)
    rows.push_back(values(g.covariance.row(i).transpose()));
  return {{"mean", values(g.mean)}, {"covariance", rows}};
}

Json curve(const std::vector<ErepsIteration>& history) {
  Json out = Json::object();
  for (const auto& [key, member] : kColumns) {
    Json column = Json::array();
    for (const ErepsIteration& i : history) column.push_back(i.*member);
    out[key] = column;
  }
  return out;
}

Json primitive(const PrompSpec& spec) {
  return {{"joints", spec.joints},       {"bases", spec.bases},    {"held_first", spec.held_first},
          {"held_last", spec.held_last}, {"width", spec.width},    {"duration", spec.duration},
          {"hold", spec.hold},           {"returns", spec.returns}};
}

Json search(const ErepsOptions& o) {
  return {{"samples", o.samples},       {"epsilon", o.epsilon},   {"kappa", o.kappa},
          {"iterations", o.iterations}, {"stop_std", o.stop_std}, {"least_std", o.least_std}};
}

Json controller(const ControllerOptions& o) {
  return {{"law", o.law == ControlLaw::kPd ? kPd : kComputedTorque},
          {"control_rate", o.control_rate},
          {"kp", values(o.kp)},
          {"kd", values(o.kd)},
          {"bandwidth", o.bandwidth},
          {"damping", o.damping},
          {"gravity_compensation", o.gravity_compensation}};
}

Json reward(const BallInCupOptions& o) {
  return {{"epsilon", o.epsilon},
          {"lambda_q", o.lambda_q},
          {"lambda_qd", o.lambda_qd},
          {"lambda_slack", o.lambda_slack},
          {"string", o.string}};
}

Json robust(const RobustOptions& o) {
  Json vary = Json::array();
  for (const Variation& v : o.vary)
    vary.push_back({{"parameter", v.parameter}, {"low", v.low}, {"high", v.high}});
  return {{"draws", o.draws},
          {"each", o.each},
          {"quantile", o.quantile ? Json(*o.quantile) : Json()},
          {"vary", vary},
          {"seed", o.seed}};
}

Json in_draws(const InDraws& d) {
  return {{"draws", d.count}, {"caught", d.caught}, {"reward", number(d.reward)}};
}

Json network_source(const NetworkSource& n) { return {{"file", n.file}, {"sha256", n.sha256}}; }

NetworkSource read_network_source(JsonObject& parent) {
  const Json* value = parent.optional("ball_network");
  if (!value) return {};
  JsonObject o(*value, parent.at("ball_network"));
  const NetworkSource out{.file = o.string("file"), .sha256 = o.string("sha256")};
  o.finish();
  return out;
}

Json task(const BallInCup& task) {
  const LearnOptions& o = task.options;
  Json out{{"start", values(task.start)},
           {"primitive", primitive(o.promp)},
           {"search", search(o.ereps)},
           {"weight_std", o.weight_std},
           {"nominal_string", o.nominal_string},
           {"reward", reward(o.reward)},
           {"simulator",
            {{"controller", controller(o.simulator.controller)},
             {"arm_step", o.simulator.arm_step},
             {"ball_step", o.simulator.ball_step},
             {"settle_time", o.simulator.settle_time},
             {"least_upright", o.simulator.least_upright},
             {"instruction_set", o.simulator.instruction_set}}}};
  // Where it is not asked for, files and fingerprints are those of a search that knows no draws.
  if (o.robust.draws > 0) out["robust"] = robust(o.robust);
  if (o.simulator.ball_network) out["ball_network"] = network_source(diffnea::network_source(task));
  return out;
}

VecX<double> read_values(JsonObject& o, const char* key) {
  const std::vector<double> x = json_numbers(o.required(key), o.at(key));
  return Eigen::Map<const VecX<double>>(x.data(), static_cast<long>(x.size()));
}

long read_integer(JsonObject& o, const char* key) {
  const Json& value = o.required(key);
  const double x = json_number(value, o.at(key));
  constexpr double kExact = 9007199254740992.0;  // 2^53
  if (!value.is_number_integer() || !(std::abs(x) < kExact))
    throw ModelError(o.at(key) + ": got " + value.dump() + ", expected an integer");
  return value.get<long>();
}

std::uint64_t read_seed(JsonObject& o) {
  const Json& value = o.required("seed");
  if (!value.is_number_unsigned())
    throw ModelError(o.at("seed") + ": got " + value.dump() + ", expected 0, 1, 2, …");
  return value.get<std::uint64_t>();
}

Gaussian read_gaussian(JsonObject& o, long size) {
  if (size > kMostParameters)
    throw ModelError(o.at("mean") + ": the primitive has " + std::to_string(size) +
                     " parameters; the limit is " + std::to_string(kMostParameters));
  Gaussian out;
  out.mean = read_values(o, "mean");
  require_length(static_cast<std::size_t>(out.mean.size()), size, o.at("mean"), "parameter");
  const Json& rows = json_array(o.required("covariance"), o.at("covariance"));
  require_length(rows.size(), size, o.at("covariance"), "row");
  out.covariance.resize(size, size);
  for (long i = 0; i < size; ++i) {
    const std::vector<double> row =
        json_numbers(rows[static_cast<std::size_t>(i)],
                     o.at("covariance") + "[" + std::to_string(i) + "]", size);
    out.covariance.row(i) = Eigen::Map<const VecX<double>>(row.data(), size).transpose();
  }
  if (!std::isfinite(kl_divergence(out, out)))
    throw ModelError(o.at("covariance") + ": is not positive definite");
  return out;
}

std::vector<ErepsIteration> read_curve(JsonObject& parent, const char* key) {
  JsonObject o(parent.required(key), parent.at(key));
  std::vector<ErepsIteration> out;
  for (const auto& [name, member] : kColumns) {
    const std::vector<double> column = json_numbers(o.required(name), o.at(name));
    if (member == kColumns[0].second) out.resize(column.size());
    require_length(column.size(), static_cast<long>(out.size()), o.at(name), "iteration");
    for (std::size_t i = 0; i < out.size(); ++i) out[i].*member = column[i];
  }
  for (std::size_t i = 0; i < out.size(); ++i) out[i].iteration = static_cast<int>(i) + 1;
  o.finish();
  return out;
}

PrompSpec read_primitive(JsonObject& parent) {
  JsonObject o(parent.required("primitive"), parent.at("primitive"));
  PrompSpec out;
  o.required("joints");
  out.joints = strings(o, "joints");
  out.bases = read_int(o, "bases");
  out.held_first = read_int(o, "held_first");
  out.held_last = read_int(o, "held_last");
  out.width = o.number("width");
  out.duration = o.number("duration");
  out.hold = o.number("hold");
  out.returns = read_boolean(o, "returns");
  o.finish();
  try {
    Promp{out};
  } catch (const Error& error) {
    throw ModelError(parent.at("primitive") + ": " + error.what());
  }
  return out;
}

ErepsOptions read_search(JsonObject& parent) {
  JsonObject o(parent.required("search"), parent.at("search"));
  const ErepsOptions out{.samples = read_int(o, "samples"),
                         .epsilon = o.number("epsilon"),
                         .kappa = o.number("kappa"),
                         .iterations = read_int(o, "iterations"),
                         .stop_std = o.number("stop_std"),
                         .least_std = o.number("least_std")};
  o.finish();
  return out;
}

ControllerOptions read_controller(JsonObject& parent, long joints) {
  JsonObject o(parent.required("controller"), parent.at("controller"));
  ControllerOptions out;
  const std::string law = o.string("law");
  if (law != kPd && law != kComputedTorque)
    throw ModelError(o.at("law") + ": got '" + law + "'; choices: " + kPd + ", " + kComputedTorque);
  out.law = law == kPd ? ControlLaw::kPd : ControlLaw::kComputedTorque;
  out.control_rate = number_between(o, "control_rate", 1.0, 1e5);
  out.kp = read_values(o, "kp");
  out.kd = read_values(o, "kd");
  for (const char* key : {"kp", "kd"}) {
    const std::size_t size = o.required(key).size();
    if (size > 0) require_length(size, joints, o.at(key), "joint");
  }
  out.bandwidth = o.number("bandwidth");
  out.damping = o.number("damping");
  out.gravity_compensation = read_boolean(o, "gravity_compensation");
  o.finish();
  return out;
}

BallInCupOptions read_reward(JsonObject& parent) {
  JsonObject o(parent.required("reward"), parent.at("reward"));
  const BallInCupOptions out{
      .epsilon = o.number("epsilon"),
      .lambda_q = o.number("lambda_q"),
      .lambda_qd = o.number("lambda_qd"),
      .lambda_slack = o.number_or("lambda_slack", 0.0),  // once there was none
      .string = o.number("string")};
  o.finish();
  return out;
}

RobustOptions read_robust(JsonObject& parent) {
  RobustOptions out;
  const Json* value = parent.optional("robust");
  if (!value) return out;
  JsonObject o(*value, parent.at("robust"));
  out.draws = read_int(o, "draws");
  out.each = read_int(o, "each");
  if (!o.required("quantile").is_null()) out.quantile = o.number("quantile");
  for_each_object(o, "vary", [&](JsonObject& v) {
    out.vary.push_back({v.string("parameter"), v.number("low"), v.number("high")});
    v.finish();
  });
  out.seed = read_seed(o);
  o.finish();
  return out;
}

InDraws read_in_draws(JsonObject& parent) {
  const Json* value = parent.optional("in_draws");
  if (!value) return {};
  JsonObject o(*value, parent.at("in_draws"));
  const InDraws out{.count = read_int(o, "draws"),
                    .caught = read_int(o, "caught"),
                    .reward = o.number_or("reward", -std::numeric_limits<double>::infinity())};
  o.finish();
  return out;
}

LearnOptions read_task(JsonObject& root, long joints) {
  JsonObject o(root.required("task"), root.at("task"));
  LearnOptions out;
  out.start = read_values(o, "start");
  require_length(static_cast<std::size_t>(out.start.size()), joints, o.at("start"), "joint");
  out.promp = read_primitive(o);
  out.joints = out.promp.joints;
  out.ereps = read_search(o);
  out.weight_std = o.number("weight_std");
  out.nominal_string = o.number("nominal_string");
  out.reward = read_reward(o);
  JsonObject s(o.required("simulator"), o.at("simulator"));
  out.simulator.controller = read_controller(s, joints);
  // Beyond these an hour would be simulated for years.
  out.simulator.arm_step = number_between(s, "arm_step", 1e-6, 1.0);
  out.simulator.ball_step = number_between(s, "ball_step", 1e-7, 1.0);
  out.simulator.settle_time = number_between(s, "settle_time", 0.0, 60.0);
  out.simulator.least_upright = s.number("least_upright");
  out.simulator.instruction_set = s.string("instruction_set");
  s.finish();
  out.robust = read_robust(o);
  o.optional("ball_network");  // of a file of its own
  o.finish();
  return out;
}

}  // namespace diffnea::io
