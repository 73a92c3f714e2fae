#include "diagnose/stretches.hpp"

#include <algorithm>
#include <cmath>

#include "recording/path_smoother.hpp"

namespace diffnea {
namespace {

/// The largest part of a joint's motion that may change from period to period.
constexpr double kRepeats = 5e-3;

/// Where the first period is so many times as far from the second as that from the third, it has
/// not settled; means over this time. Of two periods, the end of the first tells what is usual.
constexpr double kUnsettled = 5.0, kSettlingWindow = 0.1;

/// Rows that must have another one at their phase: two periods may lose a third of one.
constexpr double kCovered = 0.8;

void append(const Eigen::Ref<const RowMatX<double>>& rows, RowMatX<double>& to) {
  const long before = to.rows();
  to.conservativeResize(before + rows.rows(), rows.cols());
  to.bottomRows(rows.rows()) = rows;
}

}  // namespace

void Stretches::add(const Preprocessed& block) {
  for (long row = 0; row < block.rows();) {
    long end = row;
    while (end < block.rows() && block.segment[end] == block.segment[row]) ++end;
    const bool new_run = about_.empty() || about_.back().run != block.run;
    if (new_run) run_start_ = block.time[row];
    if (new_run || about_.back().segment[0] != block.segment[row]) begin(block, row);
    JointSeries& s = series_.back();
    const long count = end - row;
    append(block.q.middleRows(row, count), s.q);
    append(block.qd.middleRows(row, count), s.qd);
    append(block.qdd.middleRows(row, count), s.qdd);
    append(block.tau.middleRows(row, count), s.logged);
    append(block.q_logged.middleRows(row, count), positions_.back());
    row = end;
  }
}

void Stretches::begin(const Preprocessed& block, long row) {
  JointSeries s;
  s.dt = block.dt;
  s.start = block.time[row] - run_start_;
  s.run = block.run + first_run_;
  series_.push_back(std::move(s));
  positions_.emplace_back();
  Preprocessed of;
  of.source = block.source;
  of.run = block.run;
  of.joint_names = block.joint_names;
  of.dt = block.dt;
  of.has_tau = block.has_tau;
  of.time = VecX<double>::Constant(1, block.time[row]);
  of.segment = {block.segment[row]};
  about_.push_back(std::move(of));
}

void Stretches::drop_shorter(long rows) {
  for (std::size_t i = series_.size(); i-- > 0;) {
    if (series_[i].rows() >= rows) continue;
    series_.erase(series_.begin() + static_cast<long>(i));
    positions_.erase(positions_.begin() + static_cast<long>(i));
    about_.erase(about_.begin() + static_cast<long>(i));
  }
}

void Stretches::drop_first(std::size_t i, long rows) {
  JointSeries& s = series_[i];
  for (RowMatX<double>* x : {&s.q, &s.qd, &s.qdd, &s.logged, &positions_[i]})
    *x = RowMatX<double>(x->bottomRows(x->rows() - rows));
  s.start += static_cast<double>(rows) * s.dt;
  about_[i].time[0] += static_cast<double>(rows) * s.dt;
}

void Stretches::set_positions(std::size_t i, RowMatX<double> positions,
                              const PreprocessPlan& plan) {
  set_path(positions, plan, series_[i]);
  positions_[i] = std::move(positions);
}

Preprocessed Stretches::rows_of(std::size_t i, const JointSeries& s, long from,
                                long count) const {
  Preprocessed out = about_[i];
  out.q = s.q.middleRows(from, count);
  out.qd = s.qd.middleRows(from, count);
  out.qdd = s.qdd.middleRows(from, count);
  out.tau = series_[i].logged.middleRows(from, count);
  const double begin = about_[i].time[0] + s.dt * static_cast<double>(from);
  out.time = VecX<double>::LinSpaced(count, begin, begin + s.dt * static_cast<double>(count - 1));
  out.segment.assign(count, about_[i].segment[0]);
  return out;
}

void set_path(const RowMatX<double>& positions, const PreprocessPlan& plan, JointSeries& s) {
  detail::PathSmoother(plan.filter_hz, 1.0 / s.dt).smooth(positions, s.q, s.qd, s.qdd);
}

long settling_rows(double period, const JointSeries& s) {
  const long p = std::lround(period / s.dt), n = s.rows();
  if (p < 1 || n < 2 * p - p / 3) return 0;
  const auto change = [&](long from, long count) -> RowMatX<double> {
    return s.q.middleRows(from, count) - s.q.middleRows(from + p, count);
  };
  const bool thrice = n >= 3 * p;
  const long unsettled = thrice ? p : p / 3;
  const RowMatX<double> first = change(0, unsettled),
                        later = thrice ? change(p, p) : change(unsettled, n - p - unsettled);
  const VecX<double> usual =
      later.colwise().squaredNorm().transpose() / static_cast<double>(later.rows());
  const long window = std::max(1L, std::lround(kSettlingWindow / s.dt));
  for (long end = unsettled; end > window; end -= window)
    for (long j = 0; j < s.q.cols(); ++j)
      if (first.col(j).segment(end - window, window).squaredNorm() >
          kUnsettled * kUnsettled * static_cast<double>(window) * usual[j])
        return end;
  return 0;
}

bool repeats(double period, const JointSeries& s) {
  const double steps = period / s.dt;
  const long p = std::lround(steps), n = s.rows();
  if (p < 1 || p > n || std::abs(steps - static_cast<double>(p)) * static_cast<double>(n / p) > 0.5)
    return false;
  const long covered = n >= 2 * p ? n : 2 * std::max(0L, n - p);
  if (static_cast<double>(covered) < kCovered * static_cast<double>(n)) return false;
  for (long j = 0; j < s.q.cols(); ++j) {
    const VecX<double> q = s.q.col(j);
    double change = 0.0;
    for (long phase = 0; phase < p; ++phase) {
      const auto of_phase = q(Eigen::seq(phase, n - 1, p)).array();
      change += (of_phase - of_phase.mean()).square().sum();
    }
    if (std::sqrt(change) > kRepeats * (q.array() - q.mean()).matrix().norm()) return false;
  }
  return true;
}

}  // namespace diffnea
