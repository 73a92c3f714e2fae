/// Where joints rest, stick and turn, and with which states their rows go.

#include <algorithm>
#include <cmath>

#include "diagnose/evidence.hpp"
#include "diagnose/thresholds.hpp"
#include "recording/cut_off.hpp"

namespace diffnea {
namespace {

/// Slower than this share of a joint's RMS velocity it rests: what holds it then is not known.
constexpr double kRestShare = 0.01;

/// Share of the filter's weight on samples in which a joint rests, or sticks.
constexpr double kMostRest = 0.3, kMostStuck = 0.02;

bool contains(const std::vector<int>& joints, int j) { return std::ranges::count(joints, j) > 0; }

long moving_rows(const StuckRows& stuck) {
  long out = 0;
  for (const std::vector<bool>& stretch : stuck.rows) out += std::ranges::count(stretch, false);
  return out;
}

}  // namespace

StuckRows Evidence::stuck_at(int j, Turns what, const PreprocessPlan& plan,
                             const std::vector<RowMatX<double>>& positions) const {
  std::vector<VecX<double>> q;
  for (const RowMatX<double>& stretch : positions) q.emplace_back(stretch.col(j));
  const double noise = plan.q_noise[j];
  return stuck_rows(q, standstill(noise, speed_[j], acceleration_[j], plan), what);
}

void Evidence::take_standstills(const FitLayout& layout, const PreprocessPlan& plan,
                                const Stretches& collector,
                                const std::vector<RowMatX<double>>& positions,
                                const Evidence* fitted) {
  speed_ = acceleration_ = VecX<double>::Zero(num_dofs_);
  long samples = 0;
  for (const JointSeries& s : series_) {
    speed_ += s.qd.colwise().squaredNorm().transpose();
    acceleration_ += s.qdd.colwise().squaredNorm().transpose();
    samples += s.qd.rows();
  }
  speed_ = (speed_ / static_cast<double>(samples)).cwiseSqrt();
  acceleration_ = (acceleration_ / static_cast<double>(samples)).cwiseSqrt();
  std::set<int> dry = dry_joints(layout);
  if (driven_rows_.closed() && !dry.empty()) dry.insert(joints_.begin(), joints_.end());
  std::vector<int> moving;
  for (const int j : joints_) {
    if (collector.about(0).has_tau[j]) {
      stuck_[j] = stuck_at(j,
                           !dry.contains(j)                 ? Turns::kWholeStretches
                           : !fitted                        ? Turns::kLeftOut
                           : contains(fitted->sticking_, j) ? Turns::kAllLeftOut
                                                            : Turns::kKept,
                           plan, positions);
      const bool rests = fitted ? contains(fitted->resting_, j) : moving_rows(stuck_[j]) == 0;
      if (rests) {
        resting_.push_back(j);
        continue;
      }
    }
    moving.push_back(j);
  }
  if (!moving.empty()) joints_ = moving;  // else require_motion() says so
}

void Evidence::take_motion(const PreprocessPlan& plan,
                           const std::vector<RowMatX<double>>& positions, const Evidence* fitted) {
  take_events(plan, positions);
  take_states();
  bool again = false;
  for (std::size_t k = 0; k < joints_.size() && !fitted; ++k) {
    const auto at = stuck_.find(joints_[k]);
    if (at == stuck_.end() || !at->second.everywhere) continue;
    const auto column = [&](long c) {
      return !base_.col(c).segment(k * times(), times()).isZero(0.0);
    };
    long columns = 0;
    for (long c = 0; c < base_.cols(); ++c) columns += column(c);
    if (rows_between(k) >= kRowsAColumn * columns) continue;
    at->second = stuck_at(at->first, Turns::kKept, plan, positions);
    again = true;
  }
  if (again) take_states();
  for (const auto& [j, rows] : stuck_)
    if (rows.everywhere) sticking_.push_back(j);
  for (const int j : joints_)
    turns_per_second_.push_back(turn_rate(series_, j, kRestShare * speed_[j]));
}

/// One joint's event bends the equations of all that it moves.
void Evidence::take_events(const PreprocessPlan& plan,
                           const std::vector<RowMatX<double>>& positions) {
  events_.clear();
  for (const RowMatX<double>& stretch : positions)
    events_.emplace_back(static_cast<std::size_t>(stretch.rows()), false);
  const long logged =
      positions.empty() ? 0 : std::min(positions.front().cols(), std::ssize(plan.q_noise));
  for (long j = 0; j < logged; ++j) {
    std::vector<VecX<double>> q;
    for (const RowMatX<double>& stretch : positions) q.emplace_back(stretch.col(j));
    const auto rows = detail::jerky_ends(q, 1.0 / plan.dt, plan.filter_hz, plan.q_noise[j]);
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t at = 0; at < rows[i].size(); ++at)
        if (rows[i][at]) events_[i][at] = true;
  }
}

long Evidence::rows_between(long k) const {
  long out = 0, since = 0;
  for (long i = 0; i < times(); ++i) {
    const bool follows = i > 0 && stretch_[i] == stretch_[i - 1];
    since = sticks(i, k) ? 0 : follows ? since + 1 : 1;
    out += since > kNoiseOrder && !rests(i, k);
  }
  return out;
}

void Evidence::take_states() {
  const long n = num_dofs_;
  states_.clear();
  rests_.resize(times(), std::ssize(joints_));
  sticks_.resize(times(), std::ssize(joints_));
  for (long k = 0; k < std::ssize(joints_); ++k) {
    const int j = joints_[k];
    std::vector<RowMatX<double>> of_k;  // [q | q̇ | q̈ | rests | sticks]
    for (std::size_t i = 0; i < series_.size(); ++i) {
      const JointSeries& s = series_[i];
      RowMatX<double> state(s.q.rows(), 3 * n + 2);
      state << s.q, s.qd, s.qdd,
          (s.qd.col(j).array().abs() < kRestShare * speed_[j]).cast<double>().matrix(),
          VecX<double>::Zero(s.q.rows());
      if (stuck_.contains(j)) {
        const std::vector<bool>& rows = stuck_.at(j).rows[i];
        for (std::size_t at = 0; at < rows.size(); ++at) state(at, 3 * n + 1) = rows[at];
      }
      for (std::size_t at = 0; at < events_[i].size(); ++at)
        if (events_[i][at]) state(at, 3 * n + 1) = 1.0;
      of_k.push_back(std::move(state));
    }
    const MatX<double> means = means_of(k, of_k);
    states_.push_back(means.leftCols(3 * n));
    sticks_.col(k) = means.col(3 * n + 1).array().abs() > kMostStuck;  // of either sign
    rests_.col(k) = means.col(3 * n).array() > kMostRest || sticks_.col(k);
  }
}

}  // namespace diffnea
