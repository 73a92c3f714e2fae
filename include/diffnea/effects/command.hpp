#pragma once
/// Commanded positions of one run over time: what a drive with a position loop of its own reads.

#include <algorithm>
#include <limits>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// A drive holds each command until the next one, and is off in rows without one (NaN). Paths are
/// straight lines through the mean of every period, at its middle: steps would leave no derivative
/// by a delay.
class CommandPath {
 public:
  /// One position, and what it changes with.
  struct Sample {
    double q = std::numeric_limits<double>::quiet_NaN();  ///< [rad] or [m]; NaN: the drive is off
    double rate = 0.0;      ///< over time [rad/s] or [m/s]
    double by_speed = 0.0;  ///< over the largest speed [s]
  };

  CommandPath() = default;
  /// @param time  (N) [s], ascending  @param q  (N, n) [rad] or [m]; NaN: off
  /// @param gain  (n) of the run's drives, in the unit of the model's
  CommandPath(std::vector<double> time, RowMatX<double> q, VecX<double> gain)
      : time_(std::move(time)),
        is_on_(q.array() == q.array()),
        q_(std::move(q)),
        by_speed_(RowMatX<double>::Zero(q_.rows(), q_.cols())),
        gain_(std::move(gain)) {
    for (std::size_t k = 0; k < time_.size(); ++k) middle_.push_back(time_[k] + 0.5 * period(k));
    // While it is off, a drive keeps its last command; before the first one, that.
    for (long j = 0; j < q_.cols(); ++j) {
      for (long k = 1; k < q_.rows(); ++k)
        if (!is_on_(k, j)) q_(k, j) = q_(k - 1, j);
      for (long k = q_.rows() - 1; k-- > 0;)
        if (!(q_(k, j) == q_(k, j))) q_(k, j) = q_(k + 1, j);
    }
  }

  /// Gain of the run's drive, as its sidecar has it; 1 where nothing is said.
  double gain(int joint) const { return gain_[joint]; }

  /// Lets a joint's command move at most so fast [rad/s] or [m/s], as a drive does that leads its
  /// setpoint from where it is to where it is told. It begins at the first command.
  void limit_speed(int joint, double speed) {
    if (q_.rows() == 0) return;
    double setpoint = q_(0, joint), by_speed = 0.0;  // where the period begins
    for (long k = 0; k < q_.rows(); ++k) {
      const double way = q_(k, joint) - setpoint, reach = speed * period(static_cast<std::size_t>(k));
      const double share = reach > 0.0 ? std::abs(way) / reach : 1.0;  // period that the way takes
      if (share > 1.0) {
        const double step = way > 0.0 ? reach : -reach;
        q_(k, joint) = setpoint + 0.5 * step;
        by_speed_(k, joint) = by_speed + 0.5 * step / speed;
        setpoint += step;
        by_speed += step / speed;
      } else {
        setpoint = q_(k, joint);
        q_(k, joint) -= 0.5 * share * way;
        by_speed_(k, joint) = share * (by_speed + 0.5 * way / speed);
        by_speed = 0.0;
      }
    }
  }

  /// Command of a delay ago [s], which a drive acts on at a time [s] unless it is off by then. The
  /// first and the last one hold beyond the ends.
  Sample at(int joint, double time, double delay) const {
    if (time_.empty()) return {};
    if (!is_on_(std::max(beyond(time_, time) - 1, 0L), joint)) return {};
    const double then = time - delay;
    const long next = beyond(middle_, then), k = std::max(next - 1, 0L);
    const Sample here{q_(k, joint), 0.0, by_speed_(k, joint)};
    if (next == 0 || next == q_.rows()) return here;
    const double from = middle_[static_cast<std::size_t>(k)],
                 h = middle_[static_cast<std::size_t>(next)] - from;
    const double rate = (q_(k + 1, joint) - q_(k, joint)) / h;
    return {here.q + rate * (then - from), rate,
            here.by_speed + (by_speed_(k + 1, joint) - here.by_speed) * (then - from) / h};
  }

 private:
  /// Index of the first instant beyond t: that where it would be if rows were even, or next to it;
  /// else searched for.
  static long beyond(const std::vector<double>& at, double t) {
    const long last = static_cast<long>(at.size()) - 1;
    const auto is_it = [&](long k) {
      return (k == 0 || at[static_cast<std::size_t>(k - 1)] <= t) &&
             (k > last || t < at[static_cast<std::size_t>(k)]);
    };
    const double share = (t - at.front()) / (at.back() - at.front());
    if (share >= 0.0 && share <= 1.0) {
      const long even = static_cast<long>(share * static_cast<double>(last)) + 1;
      for (const long k : {even, even + 1, even - 1})
        if (k <= last + 1 && is_it(k)) return k;
    }
    return std::upper_bound(at.begin(), at.end(), t) - at.begin();
  }

  /// Time that the command of row k is held [s].
  double period(std::size_t k) const {
    if (time_.size() < 2) return 0.0;
    const std::size_t from = std::min(k, time_.size() - 2);
    return time_[from + 1] - time_[from];
  }

  std::vector<double> time_, middle_;
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> is_on_;
  RowMatX<double> q_, by_speed_;
  VecX<double> gain_;
};

}  // namespace diffnea
