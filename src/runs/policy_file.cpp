#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/policy_file.hpp>

#include "runs/json_numbers.hpp"
#include "runs/policy_json.hpp"
#include "runs/run_reader.hpp"
#include "io/sha256.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::JsonObject;

constexpr const char* kPolicySchema = "diffnea/policy/1";
constexpr const char* kCheckpointSchema = "diffnea/checkpoint/1";
constexpr const char* kWhatToDo = "; choose another -o, or --fresh to begin again";

void check_joints(const LearnedPolicy& policy, JsonObject& root) {
  if (policy.start.size() != static_cast<long>(policy.joints.size()))
    throw ModelError(root.at("start") + ": got " + std::to_string(policy.start.size()) +
                     " numbers, expected " + std::to_string(policy.joints.size()) +
                     " (one per joint)");
  for (const std::string& joint : policy.promp.joints) {
    if (std::ranges::find(policy.joints, joint) != policy.joints.end()) continue;
    std::string names;
    for (const std::string& name : policy.joints) names += (names.empty() ? "" : ", ") + name;
    throw ModelError(root.at("primitive") + ".joints: there is no joint '" + joint +
                     "'; joints: " + names);
  }
}

/// Without what says when it stops: a search may go on further than it was asked to.
ErepsOptions endless(ErepsOptions options) {
  options.iterations = ErepsOptions{}.iterations;
  options.stop_std = ErepsOptions{}.stop_std;
  return options;
}

/// Which option of two searches differs; empty: none.
std::string difference(const ErepsOptions& a, const ErepsOptions& b) {
  const Json one = io::search(endless(a)), other = io::search(endless(b));
  for (const auto& item : one.items())
    if (const Json& value = other.at(item.key()); item.value() != value)
      return item.key() + " " + item.value().dump() + ", expected " + value.dump();
  return "";
}

SearchState checkpoint_from(const std::string& text, const std::string& where,
                            const std::string& fingerprint, const Ereps& first) {
  const Json document = io::parse_json(text, where);
  JsonObject root(document, where);
  io::require_schema(root, where, kCheckpointSchema);
  if (root.string("fingerprint") != fingerprint)
    throw ModelError(where + ": is of another task: model, controller or options differ");
  if (const std::uint64_t seed = io::read_seed(root); seed != first.seed())
    throw ModelError(where + ": is of seed " + std::to_string(seed) + ", expected " +
                     std::to_string(first.seed()));
  if (const std::string what = difference(io::read_search(root), first.options()); !what.empty())
    throw ModelError(where + ": is of a search with " + what);
  const int size = first.policy().size();
  const Gaussian policy = io::read_gaussian(root, size);
  const VecX<double> best = io::read_values(root, "best");
  const std::vector<ErepsIteration> history = io::read_curve(root, "curve");
  SearchState out{first};
  out.rollouts = io::read_integer(root, "rollouts");
  out.seconds = root.number("seconds");
  root.finish();
  try {
    out.search.restore(policy, best, history);
  } catch (const Error& error) {
    throw ModelError(where + ": " + error.what());
  }
  return out;
}

}  // namespace

std::string policy_json(const LearnedPolicy& p) {
  Json out{{"schema", kPolicySchema},
           {"seed", p.seed},
           {"joints", p.joints},
           {"start", io::values(p.start)},
           {"primitive", io::primitive(p.promp)}};
  out.update(io::gaussian(p.policy));
  out["controller"] = io::controller(p.controller);
  out["reward"] = io::reward(p.reward);
  out["expected"] = io::number(p.expected);
  out["solved"] = p.solved;
  out["stopped"] = p.stopped;
  out["rollouts"] = p.rollouts;
  out["seconds"] = io::number(p.seconds);
  if (p.in_draws.count > 0) out["in_draws"] = io::in_draws(p.in_draws);
  if (!p.ball_network.sha256.empty()) out["ball_network"] = io::network_source(p.ball_network);
  out["curve"] = io::curve(p.curve);
  return io::text(out, 1);
}

void write_policy(const LearnedPolicy& policy, const std::filesystem::path& path) {
  write_file_atomically(path, policy_json(policy));
}

LearnedPolicy read_policy(const std::filesystem::path& path) {
  const std::string where = path.string();
  const Json document = io::parse_json(read_text_file(path), where);
  JsonObject root(document, where);
  io::require_schema(root, where, kPolicySchema);
  LearnedPolicy out;
  out.seed = io::read_seed(root);
  root.required("joints");
  out.joints = io::strings(root, "joints");
  out.start = io::read_values(root, "start");
  out.promp = io::read_primitive(root);
  check_joints(out, root);
  out.policy = io::read_gaussian(root, Promp(out.promp).size());
  out.controller = io::read_controller(root, static_cast<long>(out.joints.size()));
  out.reward = io::read_reward(root);
  out.expected = root.number_or("expected", -std::numeric_limits<double>::infinity());
  out.solved = root.boolean_or("solved", false);
  out.stopped = root.string_or("stopped", "");
  out.rollouts = io::read_integer(root, "rollouts");
  out.seconds = io::number_or_nan(root, "seconds");
  out.in_draws = io::read_in_draws(root);
  out.ball_network = io::read_network_source(root);
  out.curve = io::read_curve(root, "curve");
  root.finish();
  return out;
}

std::string policy_file_name(std::uint64_t seed) {
  return "policy_" + std::to_string(seed) + ".json";
}

std::string recording_file_name(std::uint64_t seed) {
  return "recording_" + std::to_string(seed) + ".csv";
}

std::string fingerprint(const BallInCup& task) {
  BallInCup until = task;
  until.options.ereps = endless(task.options.ereps);
  Json options = io::task(until);
  if (options.contains("ball_network")) options["ball_network"].erase("file");  // wherever it lies
  return io::sha256(model_to_json(task.model) + model_to_json(task.controller) +
                    io::text(options, -1));
}

void write_checkpoint(const SearchState& state, const std::string& fingerprint,
                      const std::filesystem::path& path) {
  const Ereps& search = state.search;
  Json out{{"schema", kCheckpointSchema},
           {"fingerprint", fingerprint},
           {"seed", search.seed()},
           {"search", io::search(search.options())}};
  out.update(io::gaussian(search.policy()));
  out["best"] = io::values(search.best());
  out["curve"] = io::curve(search.history());
  out["rollouts"] = state.rollouts;
  out["seconds"] = state.seconds;
  write_file_atomically(path, io::text(out, -1));
}

std::optional<SearchState> read_checkpoint(const std::filesystem::path& path,
                                           const std::string& fingerprint, const Ereps& first) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::nullopt;
  try {
    return checkpoint_from(read_text_file(path), path.string(), fingerprint, first);
  } catch (const ModelError& problem) {
    throw ModelError(problem.what() + std::string(kWhatToDo));
  }
}

}  // namespace diffnea
