#include <algorithm>
#include <array>
#include <limits>

#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/ball_network_file.hpp>
#include <diffnea/runs/policy_file.hpp>
#include <diffnea/runs/policy_result.hpp>

#include "runs/movement_json.hpp"
#include "runs/policy_json.hpp"
#include "runs/run_reader.hpp"

namespace diffnea {
namespace {

using io::for_each_object;
using io::Json;
using io::JsonObject;

namespace fs = std::filesystem;

constexpr double kNever = -std::numeric_limits<double>::infinity();

/// The run's copy of the network, under the name that it was learned with.
std::shared_ptr<const BallNetwork> read_run_network(const fs::path& folder,
                                                    const NetworkSource& source) {
  const fs::path path = folder / kBallNetworkFile;
  BallNetwork out = *read_ball_network(path);
  if (out.sha256 != source.sha256)
    throw ModelError(path.string() + ": is not the network that the run was learned in; expected " +
                     "the one with SHA-256 " + source.sha256);
  out.source = source.file;
  return std::make_shared<BallNetwork>(std::move(out));
}

BallInCup read_ball_in_cup(JsonObject& root, const fs::path& folder) {
  BallInCup out{.model = read_model(folder / "model.json"),
                .controller = read_model(folder / "controller.json"),
                .options = {},
                .start = {}};
  out.options = io::read_task(root, static_cast<long>(joint_names(out.model).size()));
  out.start = out.options.start;
  if (const NetworkSource source = io::read_task_network(root); !source.empty())
    out.options.simulator.ball_network = read_run_network(folder, source);
  return out;
}

Outcome outcome_from(JsonObject& o) {
  constexpr std::array kAll{Outcome::kInCup, Outcome::kLate,   Outcome::kFellOut,
                            Outcome::kRim,   Outcome::kBeside, Outcome::kMissed};
  const std::string word = o.string("outcome");
  if (word == "failed") return Outcome::kMissed;
  std::string choices = "failed";
  for (const Outcome outcome : kAll) {
    Execution e;
    e.verdict.outcome = outcome;
    if (outcome_word(e) == word) return outcome;
    choices += ", " + outcome_word(e);
  }
  throw ModelError(o.at("outcome") + ": got '" + word + "'; choices: " + choices);
}

Execution read_execution(JsonObject& o) {
  Execution out;
  out.seed = io::read_unsigned(o, "noise_seed");
  out.verdict = {outcome_from(o), o.string("text")};
  out.reward = o.number_or("reward", kNever);
  out.reward_wide = o.number_or("reward_wide", kNever);
  out.failure = o.string_or("failure", "");
  return out;
}

/// A series of a folder, without rows where there is no file.
struct Movements {
  std::vector<RolloutTrace> traces;
  std::vector<StickFigure> figures;
};
Movements read_movements(JsonObject& series, const char* key, std::size_t expected) {
  Movements out;
  for_each_object(series, key, [&](JsonObject& o) {
    out.figures.emplace_back();
    out.traces.push_back(io::read_movement(o, &out.figures.back()));
  });
  if (out.traces.size() != expected)
    throw ModelError(series.at(key) + ": has " + std::to_string(out.traces.size()) +
                     " movements, result.json " + std::to_string(expected));
  return out;
}

LearnedPolicy read_named_policy(const fs::path& folder, std::uint64_t seed) {
  const fs::path path = folder / policy_file_name(seed);
  LearnedPolicy out = read_policy(path);
  if (out.seed != seed)
    throw ModelError(path.string() + ".seed: got " + std::to_string(out.seed) + ", expected " +
                     std::to_string(seed) + " as result.json has it");
  return out;
}

/// All policies of a run are executed under the controller that they were learned with.
void require_same_controller(const LearnedPolicy& policy, const BallInCup& task,
                             const fs::path& folder) {
  const ControllerOptions &one = policy.controller, &all = task.options.simulator.controller;
  if (one.kp == all.kp && one.kd == all.kd && one.law == all.law &&
      one.control_rate == all.control_rate)
    return;
  throw ModelError((folder / policy_file_name(policy.seed)).string() +
                   ": its controller is not that of " + (folder / "result.json").string() +
                   "; expected the one that the run was learned with");
}

void give_traces(std::vector<Execution>& executions, std::vector<RolloutTrace>& traces) {
  for (std::size_t i = 0; i < executions.size(); ++i) executions[i].trace = std::move(traces[i]);
}

}  // namespace

LearnRun read_learn_run(const fs::path& folder) {
  LearnRun run;
  const std::string where = (folder / "result.json").string();
  const Json document = io::run_file(folder, "result.json");
  JsonObject root(document, where);
  io::require_schema(root, where, "diffnea/learn/1");
  run.task = read_ball_in_cup(root, folder);
  root.required("policies");
  for_each_object(root, "policies", [&](JsonObject& o) {
    run.policies.push_back(read_named_policy(folder, io::read_unsigned(o, "seed")));
    require_same_controller(run.policies.back(), run.task, folder);
  });
  JsonObject summary(root.required("summary"), root.at("summary"));
  run.threads = static_cast<int>(io::read_integer(summary, "threads"));
  run.seconds = io::number_or_nan(summary, "seconds");
  run.interrupted = summary.boolean_or("interrupted", false);
  io::read_value(run.reproduce, root, "reproduce", {.optional = true}, kInResult);
  if (const fs::path path = folder / "series.json"; fs::exists(path)) {
    const Json json = io::run_file(folder, "series.json");
    JsonObject series(json, path.string());
    io::require_schema(series, path.string(), "diffnea/learn-series/1");
    Movements imagined = read_movements(series, "imagined", run.policies.size());
    run.imagined = std::move(imagined.traces);
    run.figures = std::move(imagined.figures);
  }
  return run;
}

TransferRun read_transfer_run(const fs::path& folder) {
  TransferRun run;
  const std::string where = (folder / "result.json").string();
  const Json document = io::run_file(folder, "result.json");
  JsonObject root(document, where);
  io::require_schema(root, where, "diffnea/transfer/1");
  run.task = read_ball_in_cup(root, folder);
  run.world = root.string("world");
  if (const Json* clauses = root.optional("differences")) {
    run.differences.emplace();
    for (const Json& clause : io::json_array(*clauses, root.at("differences"))) {
      if (!clause.is_string())
        throw ModelError(root.at("differences") + ": got " + clause.dump() + ", expected texts");
      run.differences->push_back(clause.get<std::string>());
    }
  }
  for (const Json& seed : io::json_array(root.required("seeds"), root.at("seeds"))) {
    if (!seed.is_number_unsigned())
      throw ModelError(root.at("seeds") + ": got " + seed.dump() + ", expected 0, 1, 2, …");
    run.policies.push_back(read_named_policy(folder, seed.get<std::uint64_t>()));
  }
  root.required("policies");
  for_each_object(root, "policies", [&](JsonObject& o) {
    const std::size_t i = run.executions.size();
    if (i >= run.policies.size() || io::read_unsigned(o, "seed") != run.policies[i].seed)
      throw ModelError(o.at("seed") + ": is not the one that `seeds` has in its place");
    run.executions.push_back(read_execution(o));
  });
  root.required("repetitions");
  for_each_object(root, "repetitions",
                  [&](JsonObject& o) { run.repetitions.push_back(read_execution(o)); });
  JsonObject summary(root.required("summary"), root.at("summary"));
  if (const Json* best = summary.optional("best")) {
    const auto it =
        best->is_number_unsigned()
            ? std::ranges::find(run.policies, best->get<std::uint64_t>(), &LearnedPolicy::seed)
            : run.policies.end();
    if (it == run.policies.end()) throw ModelError(summary.at("best") + ": is none of the seeds");
    run.best = static_cast<int>(it - run.policies.begin());
  }
  run.seconds = io::number_or_nan(summary, "seconds");
  run.interrupted = summary.boolean_or("interrupted", false);
  io::read_value(run.reproduce, root, "reproduce", {.optional = true}, kInResult);
  if (const fs::path path = folder / "series.json"; fs::exists(path)) {
    const Json json = io::run_file(folder, "series.json");
    JsonObject series(json, path.string());
    io::require_schema(series, path.string(), "diffnea/transfer-series/1");
    Movements imagined = read_movements(series, "imagined", run.policies.size());
    Movements obtained = read_movements(series, "obtained", run.executions.size());
    Movements repeated = read_movements(series, "repetitions", run.repetitions.size());
    run.imagined = std::move(imagined.traces);
    run.imagined_figures = std::move(imagined.figures);
    run.figures = std::move(obtained.figures);
    give_traces(run.executions, obtained.traces);
    give_traces(run.repetitions, repeated.traces);
  }
  return run;
}

}  // namespace diffnea
