#include "recording/gridder.hpp"

#include <cmath>
#include <string>

#include <diffnea/core/error.hpp>

namespace diffnea::detail {
namespace {

/// A sample this near to a grid point is taken as it is [periods].
constexpr double kOnGrid = 0.02;
/// Neighbours of an interval that lie closer to it are not used: a cubic through points that nearly
/// coincide blows their noise up [periods].
constexpr double kTooClose = 0.3;
/// Rows of the grid for a row of the recording, at most: memory in proportion to the file.
constexpr long kMostPerRow = 20, kUnsuspicious = 100'000;

}  // namespace

bool is_gap(const Recording& r, long i, bool velocity) {
  for (long j = 0; j < r.q.cols(); ++j)
    if (std::isnan(r.q(i, j)) || (r.has_tau[j] && std::isnan(r.tau(i, j))) ||
        (velocity && std::isnan(r.qd(i, j))))
      return true;
  return false;
}

Gridder::Gridder(const Options& options, int num_joints)
    : options_(options), n_(num_joints), num_columns_((options.velocity ? 3 : 2) * num_joints) {}

bool Gridder::push(const Recording& r, long i) {
  if (is_gap(r, i, options_.velocity)) return true;
  ++pushed_;
  if (emitted_ > kMostPerRow * pushed_ + kUnsuspicious)
    throw DataError(r.source + ": its rows are too few for their usual period of " +
                    std::to_string(options_.dt) + " s: " + std::to_string(emitted_) +
                    " would have to be interpolated between " + std::to_string(pushed_) +
                    "; leave out rows that follow each other too closely, or split the file");
  const double t = r.time[i];
  const bool first = times_.empty();
  if (!first && t - times_.back() > options_.max_gap * options_.dt) return false;
  if (first) {
    t0_ = t;
    next_ = 0;
  }
  if (first) held_.clear();
  times_.push_back(t);
  for (int j = 0; j < n_; ++j) raw_.push_back(r.q(i, j));
  for (int j = 0; j < n_; ++j) {
    raw_.push_back(r.tau(i, j));
    held_.push_back(r.tau(i, j));
  }
  if (options_.velocity)
    for (int j = 0; j < n_; ++j) raw_.push_back(r.qd(i, j));
  if (options_.average_hold && r.info.torque_sampling == TorqueSampling::kHold) place_held_torque();
  // With four rows the second interval has a neighbour on either side.
  if (times_.size() == 3) emit_interval(0);
  if (times_.size() == 4) {
    emit_interval(1);
    times_.erase(times_.begin());
    raw_.erase(raw_.begin(), raw_.begin() + num_columns_);
  }
  return true;
}

/// A held torque is a mean over the period that it begins. At the instant between two of them a
/// band-limited torque has the value (7 (τ_{k−1} + τ_k) − τ_{k−2} − τ_{k+1})/12, exact for cubics
/// (finite-volume reconstruction, e.g. LeVeque 2002, sec. 10.3); (τ_{k−1} + τ_k)/2 where a
/// neighbour is missing or the rows are not uniform.
void Gridder::place_held_torque() {
  const std::size_t n = static_cast<std::size_t>(n_), stamps = times_.size(),
                    known = held_.size() / n;
  const auto tau = [&](std::size_t back, std::size_t j) {
    return held_[(known - 1 - back) * n + j];
  };
  const auto place = [&](std::size_t back, std::size_t j, double value) {
    raw_[(stamps - 1 - back) * static_cast<std::size_t>(num_columns_) + n + j] = value;
  };
  bool uniform = known >= 4 && stamps >= 4;
  for (std::size_t k = 1; uniform && k < 4; ++k)
    uniform =
        std::abs(times_[stamps - k] - times_[stamps - k - 1] - options_.dt) < kOnGrid * options_.dt;
  for (std::size_t j = 0; j < n; ++j) {
    if (known >= 2) place(0, j, 0.5 * (tau(1, j) + tau(0, j)));
    if (uniform) place(1, j, (7.0 * (tau(2, j) + tau(1, j)) - tau(3, j) - tau(0, j)) / 12.0);
  }
  if (known > 3) held_.erase(held_.begin(), held_.begin() + n_);
}

void Gridder::finish_segment() {
  const std::size_t size = times_.size();
  if (size == 2) emit_interval(0);
  if (size == 3) emit_interval(1);
  if (size > 0 && std::abs(t0_ + static_cast<double>(next_) * options_.dt - times_.back()) <=
                      kOnGrid * options_.dt)
    rows.insert(rows.end(), raw_.end() - num_columns_, raw_.end());
  times_.clear();
  raw_.clear();
}

/// Grid points from raw row k up to, not including, row k + 1.
void Gridder::emit_interval(std::size_t k) {
  const double dt = options_.dt;
  for (;; ++next_) {
    const double t = t0_ + static_cast<double>(next_) * dt;
    if (t >= times_[k + 1] - kOnGrid * dt) return;
    ++emitted_;
    const double* a = raw_.data() + k * num_columns_;
    if (std::abs(t - times_[k]) <= kOnGrid * dt) {
      rows.insert(rows.end(), a, a + num_columns_);
      continue;
    }
    // Lagrange's weights over the interval's ends and its neighbours.
    std::size_t node[4];
    int num_nodes = 0;
    if (k > 0 && times_[k] - times_[k - 1] > kTooClose * dt) node[num_nodes++] = k - 1;
    node[num_nodes++] = k;
    node[num_nodes++] = k + 1;
    if (k + 2 < times_.size() && times_[k + 2] - times_[k + 1] > kTooClose * dt)
      node[num_nodes++] = k + 2;
    double weight[4];
    for (int i = 0; i < num_nodes; ++i) {
      weight[i] = 1.0;
      for (int m = 0; m < num_nodes; ++m)
        if (m != i) weight[i] *= (t - times_[node[m]]) / (times_[node[i]] - times_[node[m]]);
    }
    const double s = (t - times_[k]) / (times_[k + 1] - times_[k]);
    const double* b = a + num_columns_;
    for (int c = 0; c < num_columns_; ++c) {
      const bool torque = c >= n_ && c < 2 * n_;
      double x = 0.0;
      if (torque)
        x = (1.0 - s) * a[c] + s * b[c];
      else
        for (int i = 0; i < num_nodes; ++i) x += weight[i] * raw_[node[i] * num_columns_ + c];
      rows.push_back(x);
    }
  }
}

}  // namespace diffnea::detail
