#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/runs/policy_file.hpp>
#include <diffnea/runs/policy_result.hpp>

#include "runs/movement_json.hpp"
#include "runs/policy_rows.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::number;
using io::text;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::optional<std::uint64_t> seed_of(const std::vector<LearnedPolicy>& policies, int index) {
  if (index < 0) return std::nullopt;
  return policies[static_cast<std::size_t>(index)].seed;
}

int count_solved(const std::vector<LearnedPolicy>& policies) {
  return static_cast<int>(std::ranges::count(policies, true, &LearnedPolicy::solved));
}

int successes(const std::vector<Execution>& executions) {
  return static_cast<int>(std::ranges::count_if(executions, &Execution::success));
}

LearnedRow learned(const LearnedPolicy& p) {
  LearnedRow out{.seed = p.seed,
                 .file = policy_file_name(p.seed),
                 .expected = p.expected,
                 .solved = p.solved,
                 .stopped = p.stopped,
                 .first_capture = {},
                 .iterations = static_cast<long>(p.curve.size()),
                 .rollouts = p.rollouts,
                 .seconds = p.seconds,
                 .curve = p.curve,
                 .in_draws = p.in_draws};
  if (const int captured = first_capture(p); captured > 0) out.first_capture = captured;
  return out;
}

ExecutedRow executed(const Execution& e) {
  return {e.seed, e.success(), outcome_word(e), e.verdict.text, e.reward, e.reward_wide, e.failure};
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
  LearnFile out{
      .model = run.task.model.name,
      .controller = run.task.controller.name,
      .fingerprint = fingerprint(run.task),
      .task = io::task_file(run.task),
      .solved = share_of(count_solved(run.policies), static_cast<int>(run.policies.size())),
      .best = seed_of(run.policies, best_policy(run.policies)),
      .rollouts = 0,
      .cpu_seconds = 0.0,
      .seconds = run.seconds,
      .threads = run.threads,
      .interrupted = run.interrupted,
      .policies = {},
      .reproduce = run.reproduce};
  for (const LearnedPolicy& p : run.policies) {
    out.policies.push_back(learned(p));
    out.rollouts += p.rollouts;
    out.cpu_seconds += p.seconds;
  }
  return io::file_text("diffnea/learn/1", out, kInResult);
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
  const int n = static_cast<int>(run.executions.size()),
            again = static_cast<int>(run.repetitions.size());
  TransferFile out{
      .model = run.task.model.name,
      .controller = run.task.controller.name,
      .world = run.world,
      .differences = run.differences,
      .fingerprint = fingerprint(run.task),
      .task = io::task_file(run.task),
      .transferred = share_of(successes(run.executions), n),
      .repeated = {},
      .best = seed_of(run.policies, run.best),
      .solved = share_of(count_solved(run.policies), static_cast<int>(run.policies.size())),
      .seconds = run.seconds,
      .interrupted = run.interrupted,
      .seeds = {},
      .policies = {},
      .repetitions = {},
      .reproduce = run.reproduce};
  if (again > 0) out.repeated = share_of(successes(run.repetitions), again);
  for (const LearnedPolicy& p : run.policies) out.seeds.push_back(p.seed);
  for (std::size_t i = 0; i < run.executions.size(); ++i) {
    const LearnedPolicy& p = run.policies.at(i);
    const Execution& e = run.executions[i];
    out.policies.push_back({p.seed, policy_file_name(p.seed), p.expected, p.solved, executed(e),
                            path_error(run.imagined.at(i), e.trace)});
  }
  for (const Execution& e : run.repetitions) out.repetitions.push_back(executed(e));
  return io::file_text("diffnea/transfer/1", out, kInResult);
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
