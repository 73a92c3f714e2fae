#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/policy_file.hpp>

#include "io/sha256.hpp"
#include "runs/policy_json.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::JsonObject;

constexpr const char* kPolicySchema = "diffnea/policy/1";
constexpr const char* kCheckpointSchema = "diffnea/checkpoint/1";
constexpr const char* kWhatToDo = "; choose another -o, or --fresh to begin again";

/// A search between two iterations.
struct CheckpointFile {
  std::string fingerprint;
  std::uint64_t seed = 0;
  ErepsOptions search;
  VecX<double> mean;
  MatX<double> covariance;
  VecX<double> best;
  std::vector<ErepsIteration> curve;
  long rollouts = 0;
  double seconds = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Checkpoint", "A search between two iterations.", {.exact = true});
    list.field("fingerprint", &CheckpointFile::fingerprint, "SHA-256 of the task.");
    list.field("seed", &CheckpointFile::seed, "Of the search.");
    list.field("search", &CheckpointFile::search, "Its options.");
    list.field("mean", &CheckpointFile::mean, "Of the Gaussian over the weights.");
    list.field("covariance", &CheckpointFile::covariance, "Its covariance by rows.");
    list.field("best", &CheckpointFile::best, "Sample so far.");
    list.columns("curve", &CheckpointFile::curve, "One value an iteration.");
    list.field("rollouts", &CheckpointFile::rollouts, "Executed so far.");
    list.field("seconds", &CheckpointFile::seconds, "That passed so far.", {.unit = "s"});
  }
};

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
  const Json one = io::fields_json(endless(a), kInResult),
             other = io::fields_json(endless(b), kInResult);
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
  CheckpointFile file;
  io::read_fields(file, root, kInResult);
  if (file.seed != first.seed())
    throw ModelError(where + ": is of seed " + std::to_string(file.seed) + ", expected " +
                     std::to_string(first.seed()));
  if (const std::string what = difference(file.search, first.options()); !what.empty())
    throw ModelError(where + ": is of a search with " + what);
  const Gaussian policy{file.mean, file.covariance};
  io::check_gaussian(policy, first.policy().size(), where);
  io::number_iterations(file.curve);
  SearchState out{first, file.rollouts, file.seconds};
  try {
    out.search.restore(policy, file.best, file.curve);
  } catch (const Error& error) {
    throw ModelError(where + ": " + error.what());
  }
  return out;
}

}  // namespace

std::string policy_json(const LearnedPolicy& policy) {
  return io::file_text(kPolicySchema, policy, kInResult);
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
  io::read_fields(out, root, kInResult);
  io::check_primitive(out.promp, where + ".primitive");
  check_joints(out, root);
  io::check_gaussian(out.policy, Promp(out.promp).size(), where);
  io::check_controller(out.controller, static_cast<long>(out.joints.size()), where + ".controller");
  io::number_iterations(out.curve);
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
  Json options = io::fields_json(io::task_file(until), kInResult);
  if (options.contains("ball_network")) options["ball_network"].erase("file");  // wherever it lies
  return io::sha256(model_to_json(task.model) + model_to_json(task.controller) +
                    io::text(options, -1));
}

void write_checkpoint(const SearchState& state, const std::string& fingerprint,
                      const std::filesystem::path& path) {
  const Ereps& search = state.search;
  const CheckpointFile file{.fingerprint = fingerprint,
                            .seed = search.seed(),
                            .search = search.options(),
                            .mean = search.policy().mean,
                            .covariance = search.policy().covariance,
                            .best = search.best(),
                            .curve = search.history(),
                            .rollouts = state.rollouts,
                            .seconds = state.seconds};
  Json out{{"schema", kCheckpointSchema}};
  out.update(io::fields_json(file, kInResult));
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
