#include <algorithm>
#include <atomic>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/parallel.hpp>
#include <diffnea/policy/rollouts.hpp>

#include "core/c_numbers.hpp"
#include "core/constants.hpp"

namespace diffnea {
namespace {

int find_joint(const std::vector<std::string>& joints, const std::string& name) {
  const auto it = std::ranges::find(joints, name);
  if (it != joints.end()) return static_cast<int>(it - joints.begin());
  std::string known;
  for (const std::string& j : joints) known += (known.empty() ? "" : ", ") + j;
  throw Error("Rollouts: the primitive moves joint '" + name +
              "', which the simulator does not drive; joints: " + known);
}

std::string words(const LimitViolation& v) {
  char text[160];
  detail::print(text, sizeof text, ": at %.3f s its desired %s is %.4g, the limit is %.4g", v.time,
                v.velocity ? "velocity" : "position", v.value, v.bound);
  return v.joint + text;
}

/// Keeps a row of a trace per look.
void keep(RolloutTrace& trace, long row, double time, const Lanes& seen, const Lanes& desired) {
  trace.time[row] = time;
  trace.values.row(row) = seen.col(0).transpose();
  trace.q_desired.row(row) = desired.col(0).transpose();
}

/// Lanes that fail while their episode goes on end with −∞.
void note_failures(const std::vector<std::string>& failures, std::span<const long> rows,
                   std::vector<char>& ended, RolloutResult& out) {
  if (failures.empty()) return;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (ended[i] || failures[i].empty()) continue;
    ended[i] = 1;
    out.failures[static_cast<std::size_t>(rows[i])] = failures[i];
  }
}

bool all(const std::vector<char>& ended) {
  return std::ranges::all_of(ended, [](char e) { return e != 0; });
}

}  // namespace

Rollouts::Rollouts(const Simulator& simulator, const Task& task, Promp promp, VecX<double> start,
                   MotionLimits limits, int threads)
    : promp_(std::move(promp)),
      start_(std::move(start)),
      limits_(std::move(limits)),
      period_(simulator.period()) {
  const std::vector<std::string>& joints = simulator.joints();
  for (const std::string& j : promp_.spec().joints) rows_.push_back(find_joint(joints, j));
  const long n = static_cast<long>(joints.size());
  require_size("Rollouts: start", start_.size(), n, "joint");
  require_size("Rollouts: lower limits", limits_.lower.size(), n, "joint");
  require_size("Rollouts: upper limits", limits_.upper.size(), n, "joint");
  require_size("Rollouts: velocity limits", limits_.velocity.size(), n, "joint");
  if (threads < 1)
    throw Error("Rollouts: " + std::to_string(threads) + " threads, expected at least 1");
  if (!(period_ > 0.0) || simulator.lanes() < 1)
    throw Error("Rollouts: the simulator has no period, or no lanes");

  const long steps = std::lround((promp_.spec().duration + promp_.spec().hold) / period_);
  phi_.resize(steps + 1, promp_.parameters_per_joint());
  phi_d_.resizeLike(phi_);
  VecX<double> phi, phi_d;
  for (long k = 0; k <= steps; ++k) {
    promp_.features(static_cast<double>(k) * period_, phi, phi_d);
    phi_.row(k) = phi.transpose();
    phi_d_.row(k) = phi_d.transpose();
  }
  for (int i = 0; i < threads; ++i) workers_.push_back({simulator.clone(), task.clone()});
}

void Rollouts::command(long k, const Lanes& weights, Lanes& q, Lanes& qd) const {
  // Summed lane by lane in the same order, however many lanes there are; a matrix product is not.
  long at = 0;
  for (const int row : rows_) {
    q.row(row).setConstant(start_[row]);
    qd.row(row).setZero();
    for (long b = 0; b < phi_.cols(); ++b, ++at) {
      q.row(row) += phi_(k, b) * weights.row(at);
      qd.row(row) += phi_d_(k, b) * weights.row(at);
    }
  }
}

VecX<double> Rollouts::excess(const Lanes& weights) const {
  const long lanes = weights.cols();
  Lanes q = start_.replicate(1, lanes), qd = Lanes::Zero(start_.size(), lanes);
  Lanes position = qd, velocity = qd;  // the largest so far
  for (long k = 0; k < phi_.rows(); ++k) {
    command(k, weights, q, qd);
    for (const int row : rows_) {
      position.row(row) = position.row(row)
                              .cwiseMax((q.row(row).array() - limits_.upper[row]).matrix())
                              .cwiseMax((limits_.lower[row] - q.row(row).array()).matrix());
      velocity.row(row) =
          velocity.row(row).cwiseMax((qd.row(row).array().abs() - limits_.velocity[row]).matrix());
    }
  }
  return (position + velocity).colwise().sum().transpose();
}

std::optional<LimitViolation> Rollouts::violation(const VecX<double>& theta) const {
  require_size("Rollouts::violation", theta.size(), promp_.size(), "parameter");
  const Lanes weights = theta;
  Lanes q = start_, qd = Lanes::Zero(start_.size(), 1);
  for (long k = 0; k < phi_.rows(); ++k) {
    command(k, weights, q, qd);
    for (std::size_t j = 0; j < rows_.size(); ++j) {
      const int row = rows_[j];
      const double x = q(row, 0), v = qd(row, 0), largest = limits_.velocity[row];
      LimitViolation out{promp_.spec().joints[j], static_cast<double>(k) * period_, x, 0.0, false};
      if (x < limits_.lower[row] || x > limits_.upper[row]) {
        out.bound = x < limits_.lower[row] ? limits_.lower[row] : limits_.upper[row];
        return out;
      }
      if (std::abs(v) > largest) {
        out.value = v;
        out.bound = std::copysign(largest, v);
        out.velocity = true;
        return out;
      }
    }
  }
  return std::nullopt;
}

bool Rollouts::execute(Worker& worker, const RowMatX<double>& theta, std::span<const long> rows,
                       const std::vector<std::uint64_t>& seeds, RolloutResult& out,
                       RolloutTrace* trace) const {
  Simulator& simulator = *worker.simulator;
  Task& task = *worker.task;
  const long n = static_cast<long>(rows.size()), lanes = simulator.lanes();
  Starts starts{start_.replicate(1, n), std::vector<std::uint64_t>(rows.size(), 0)};
  Lanes weights = Lanes::Zero(promp_.size(), lanes);  // idle lanes stay at the start
  for (long i = 0; i < n; ++i) {
    const long row = rows[static_cast<std::size_t>(i)];
    weights.col(i) = theta.row(row).transpose();
    if (!seeds.empty())
      starts.seeds[static_cast<std::size_t>(i)] = seeds[static_cast<std::size_t>(row)];
  }
  Lanes q = start_.replicate(1, lanes), qd = Lanes::Zero(start_.size(), lanes);
  std::vector<char> ended(rows.size(), 0);

  simulator.reset(starts);
  task.begin(simulator, static_cast<int>(n));
  command(0, weights, q, qd);
  for (long k = 0;; ++k) {  // seen and desired at t_k; the command of t_k moves the world to t_k+1
    const double time = static_cast<double>(k) * period_;
    note_failures(simulator.failures(), rows, ended, out);
    task.look(time, simulator.observe(), ended);
    if (trace) keep(*trace, k, time, simulator.observe(), q);
    if (k + 1 == phi_.rows() || all(ended)) {
      if (trace) {
        trace->time.conservativeResize(k + 1);
        trace->values.conservativeResize(k + 1, Eigen::NoChange);
        trace->q_desired.conservativeResize(k + 1, Eigen::NoChange);
      }
      break;
    }
    simulator.step(q, qd);
    command(k + 1, weights, q, qd);
  }

  const VecX<double> rewards = task.rewards();
  const std::vector<char> solved = task.solved();
  require_size("Rollouts: the task's rewards", rewards.size(), n, "world");
  if (!solved.empty())
    require_size("Rollouts: the task's solved", static_cast<long>(solved.size()), n, "world");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::size_t row = static_cast<std::size_t>(rows[i]);
    const bool failed = !out.failures[row].empty();
    out.rewards[rows[i]] = failed ? -kInfinity : rewards[static_cast<long>(i)];
    if (!solved.empty()) out.solved[row] = !failed && solved[i];
  }
  return !solved.empty();
}

RolloutResult Rollouts::run(const RowMatX<double>& theta, const std::vector<std::uint64_t>& seeds) {
  require_size("Rollouts::run", theta.cols(), promp_.size(), "parameter");
  if (!seeds.empty())
    require_size("Rollouts::run: seeds", static_cast<long>(seeds.size()), theta.rows(), "rollout");
  for (long i = 0; i < theta.rows(); ++i)
    if (!theta.row(i).allFinite())
      throw DataError("Rollouts: parameters of rollout " + std::to_string(i) + " are not finite");

  const std::size_t N = static_cast<std::size_t>(theta.rows());
  RolloutResult out{VecX<double>(theta.rows()), std::vector<char>(N, 0),
                    std::vector<std::string>(N)};
  const VecX<double> beyond = excess(theta.transpose());
  out.rewards = -1.0 - beyond.array();
  std::vector<long> rows;  // that are executed
  for (long i = 0; i < theta.rows(); ++i)
    if (!(beyond[i] > 0.0)) rows.push_back(i);

  // Full lanes, unless threads would then have none.
  const std::size_t threads = workers_.size(),
                    lanes = static_cast<std::size_t>(workers_[0].simulator->lanes());
  const std::size_t batch =
      std::clamp<std::size_t>((rows.size() + threads - 1) / threads, 1, lanes);
  std::atomic<bool> tells_solved{false};
  parallel_for((rows.size() + batch - 1) / batch, threads, [&](std::size_t k, std::size_t w) {
    const std::size_t at = k * batch;
    if (execute(workers_[w], theta, std::span(rows).subspan(at, std::min(batch, rows.size() - at)),
                seeds, out))
      tells_solved = true;
  });
  count_ += static_cast<long>(rows.size());
  if (!tells_solved) out.solved.clear();
  return out;
}

RolloutTrace Rollouts::trace(const VecX<double>& theta, std::uint64_t seed) {
  require_size("Rollouts::trace", theta.size(), promp_.size(), "parameter");
  RolloutTrace out;
  out.channels = workers_[0].simulator->channels();
  if (const std::optional<LimitViolation> v = violation(theta)) {
    out.reward = -1.0 - excess(theta)[0];
    out.failure = words(*v);
    return out;
  }
  const long rows = phi_.rows();
  out.time.resize(rows);
  out.values.resize(rows, static_cast<long>(out.channels.size()));
  out.q_desired.resize(rows, start_.size());
  RolloutResult result{VecX<double>(1), {0}, {""}};
  const long only = 0;
  execute(workers_[0], theta.transpose(), std::span(&only, 1), {seed}, result, &out);
  ++count_;
  out.reward = result.rewards[0];
  out.solved = result.solved[0] != 0;
  out.failure = result.failures[0];
  return out;
}

}  // namespace diffnea
