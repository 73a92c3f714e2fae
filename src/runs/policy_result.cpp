#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/runs/policy_file.hpp>
#include <diffnea/runs/policy_result.hpp>

#include "runs/fields_json.hpp"
#include "runs/movement_json.hpp"
#include "runs/policy_json.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::number;
using io::text;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Json share(const Share& s) {
  return {{"k", s.k},
          {"n", s.n},
          {"share", s.n > 0 ? Json(static_cast<double>(s.k) / s.n) : Json()},
          {"low", s.low},
          {"high", s.high}};
}

Json seed_of(const std::vector<LearnedPolicy>& policies, int index) {
  return index < 0 ? Json() : Json(policies[static_cast<std::size_t>(index)].seed);
}

int count_solved(const std::vector<LearnedPolicy>& policies) {
  return static_cast<int>(std::ranges::count(policies, true, &LearnedPolicy::solved));
}

int successes(const std::vector<Execution>& executions) {
  return static_cast<int>(std::ranges::count_if(executions, &Execution::success));
}

Json learned(const LearnedPolicy& p) {
  const int captured = first_capture(p);
  Json out{{"seed", p.seed},
           {"file", policy_file_name(p.seed)},
           {"expected", number(p.expected)},
           {"solved", p.solved},
           {"stopped", p.stopped},
           {"first_capture", captured > 0 ? Json(captured) : Json()},
           {"iterations", p.curve.size()},
           {"rollouts", p.rollouts},
           {"seconds", number(p.seconds)},
           {"curve", io::curve(p.curve)}};
  if (p.in_draws.count > 0) out["in_draws"] = io::in_draws(p.in_draws);
  return out;
}

Json executed(const Execution& e) {
  return {{"noise_seed", e.seed},
          {"success", e.success()},
          {"outcome", outcome_word(e)},
          {"text", e.verdict.text},
          {"reward", number(e.reward)},
          {"reward_wide", number(e.reward_wide)},
          {"failure", e.failure.empty() ? Json() : Json(e.failure)}};
}

/// The movements with their figures, all in one plane. @param rate  of the rows [Hz]
Json movements(const BallInCup& task, const std::vector<RolloutTrace>& traces, const SideView& view,
               double rate) {
  Json out = Json::array();
  for (const RolloutTrace& full : traces) {
    const RolloutTrace trace = io::thinned(full, rate);
    if (trace.time.size() == 0) {
      out.push_back(io::movement(trace, nullptr));
      continue;
    }
    const StickFigure figure = stick_figure(task.model, trace, view);
    out.push_back(io::movement(trace, &figure));
  }
  return out;
}

Json view_json(const SideView& view) {
  return {{"across", {number(view.x), number(view.y), 0.0}}, {"up", {0.0, 0.0, 1.0}}};
}

std::vector<RolloutTrace> traces_of(const std::vector<Execution>& executions) {
  std::vector<RolloutTrace> out;
  for (const Execution& e : executions) out.push_back(e.trace);
  return out;
}

/// Ball at a time between two rows; NaN beyond them.
Eigen::RowVector3d ball_at(const VecX<double>& time, const RowMatX<double>& ball, double t) {
  const long next = std::lower_bound(time.begin(), time.end(), t) - time.begin();
  if (next == time.size()) return Eigen::RowVector3d::Constant(kNaN);
  if (time[next] == t || next == 0) return ball.row(next);
  const double share = (t - time[next - 1]) / (time[next] - time[next - 1]);
  return (1.0 - share) * ball.row(next - 1) + share * ball.row(next);
}

}  // namespace

Share share_of(int k, int n) {
  Share out{.k = k, .n = n};
  if (n <= 0) return out;
  constexpr double z = 1.959963984540054;  // 95 %
  const double N = n, p = k / N, middle = p + z * z / (2.0 * N),
               half = z * std::sqrt(p * (1.0 - p) / N + z * z / (4.0 * N * N)),
               scale = 1.0 + z * z / N;
  out.low = k == 0 ? 0.0 : (middle - half) / scale;
  out.high = k == n ? 1.0 : (middle + half) / scale;
  return out;
}

int best_policy(const std::vector<LearnedPolicy>& policies) {
  const auto rank = [](const LearnedPolicy& p) { return std::pair(p.solved, p.expected); };
  int best = -1;
  for (std::size_t i = 0; i < policies.size(); ++i)
    if (best < 0 || rank(policies[i]) > rank(policies[static_cast<std::size_t>(best)]))
      best = static_cast<int>(i);
  return best;
}

int first_capture(const LearnedPolicy& policy) {
  const auto it = std::ranges::find_if(
      policy.curve, [](const ErepsIteration& i) { return i.solved_share > 0.0; });
  return it == policy.curve.end() ? 0 : it->iteration;
}

PathError path_error(const RolloutTrace& imagined, const RolloutTrace& obtained) {
  PathError out{kNaN, kNaN};
  if (imagined.time.size() == 0 || obtained.time.size() == 0) return out;
  const RolloutTrace a = io::thinned(imagined), b = io::thinned(obtained);
  const RowMatX<double> in_model = points_of(a, "ball"), in_world = points_of(b, "ball");
  const VecX<double> phase = channel_of(a, "phase");
  double sum = 0.0, last = kNaN;
  long rows = 0;
  for (long k = 0; k < a.time.size(); ++k) {
    if (phase[k] == static_cast<double>(BallPhase::kCaptured)) {  // the model's lies at rest now
      out.at_capture = last;
      break;
    }
    const double squared = (in_model.row(k) - ball_at(b.time, in_world, a.time[k])).squaredNorm();
    if (!std::isfinite(squared)) break;
    sum += squared;
    last = std::sqrt(squared);
    ++rows;
  }
  if (rows > 0) out.rms = std::sqrt(sum / static_cast<double>(rows));
  return out;
}

std::string outcome_word(const Execution& execution) {
  if (!execution.failure.empty()) return "failed";
  switch (execution.verdict.outcome) {
    case Outcome::kInCup:
      return "in_cup";
    case Outcome::kLate:
      return "late";
    case Outcome::kFellOut:
      return "fell_out";
    case Outcome::kRim:
      return "rim";
    case Outcome::kBeside:
      return "beside";
    case Outcome::kMissed:
      break;
  }
  return "missed";
}

std::string learn_result_json(const LearnRun& run) {
  Json policies = Json::array();
  long rollouts = 0;
  double seconds = 0.0;
  for (const LearnedPolicy& p : run.policies) {
    policies.push_back(learned(p));
    rollouts += p.rollouts;
    seconds += p.seconds;
  }
  const int solved = count_solved(run.policies), n = static_cast<int>(run.policies.size());
  return text({{"schema", "diffnea/learn/1"},
               {"model", run.task.model.name},
               {"controller", run.task.controller.name},
               {"fingerprint", fingerprint(run.task)},
               {"task", io::task(run.task)},
               {"summary",
                {{"solved", share(share_of(solved, n))},
                 {"best", seed_of(run.policies, best_policy(run.policies))},
                 {"rollouts", rollouts},
                 {"cpu_seconds", number(seconds)},
                 {"seconds", number(run.seconds)},
                 {"threads", run.threads},
                 {"interrupted", run.interrupted}}},
               {"policies", policies},
               {"reproduce", io::fields_json(run.reproduce, kInResult)}},
              1);
}

std::string learn_series_json(const LearnRun& run) {
  const SideView view = side_view(run.imagined);
  return io::readable_series([&](double rate) {
    return text({{"schema", "diffnea/learn-series/1"},
                 {"view", view_json(view)},
                 {"imagined", movements(run.task, run.imagined, view, rate)}},
                -1);
  });
}

std::string transfer_result_json(const TransferRun& run) {
  Json policies = Json::array();
  for (std::size_t i = 0; i < run.executions.size(); ++i) {
    const LearnedPolicy& p = run.policies.at(i);
    Json row{{"seed", p.seed},
             {"file", policy_file_name(p.seed)},
             {"expected", number(p.expected)},
             {"solved", p.solved}};
    row.update(executed(run.executions[i]));
    const PathError error = path_error(run.imagined.at(i), run.executions[i].trace);
    row["path_error"] = {{"at_capture", number(error.at_capture)}, {"rms", number(error.rms)}};
    policies.push_back(row);
  }
  Json repetitions = Json::array();
  for (const Execution& e : run.repetitions) repetitions.push_back(executed(e));
  const int n = static_cast<int>(run.executions.size()),
            again = static_cast<int>(run.repetitions.size());
  return text(
      {{"schema", "diffnea/transfer/1"},
       {"model", run.task.model.name},
       {"controller", run.task.controller.name},
       {"world", run.world},
       {"fingerprint", fingerprint(run.task)},
       {"task", io::task(run.task)},
       {"summary",
        {{"transferred", share(share_of(successes(run.executions), n))},
         {"repeated", again > 0 ? share(share_of(successes(run.repetitions), again)) : Json()},
         {"best", seed_of(run.policies, run.best)},
         {"solved",
          share(share_of(count_solved(run.policies), static_cast<int>(run.policies.size())))},
         {"seconds", number(run.seconds)},
         {"interrupted", run.interrupted}}},
       {"seeds",
        [&] {
          Json seeds = Json::array();
          for (const LearnedPolicy& p : run.policies) seeds.push_back(p.seed);
          return seeds;
        }()},
       {"policies", policies},
       {"repetitions", repetitions},
       {"reproduce", io::fields_json(run.reproduce, kInResult)}},
      1);
}

std::string transfer_series_json(const TransferRun& run) {
  std::vector<RolloutTrace> all = run.imagined;
  for (const Execution& e : run.executions) all.push_back(e.trace);
  const SideView view = side_view(all);
  return io::readable_series([&](double rate) {
    Json repetitions = Json::array();
    for (const Execution& e : run.repetitions)
      repetitions.push_back(io::movement(io::thinned(e.trace, rate), nullptr));
    return text({{"schema", "diffnea/transfer-series/1"},
                 {"view", view_json(view)},
                 {"imagined", movements(run.task, run.imagined, view, rate)},
                 {"obtained", movements(run.task, traces_of(run.executions), view, rate)},
                 {"repetitions", repetitions}},
                -1);
  });
}

}  // namespace diffnea
