#pragma once
/// Commanded positions of one run over time: what a drive with a position loop of its own reads.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Stretch of time in which a simulation takes commands as a straight line [s]; none where it ends
/// as it begins.
struct SimulationStep {
  double from = 0.0;  ///< where it begins
  double to = 0.0;    ///< where it ends
};

/// A drive holds each command until the next one, and is off in rows without one (NaN). What a
/// simulation takes of it over one of its steps is the straight line with the same mean and the
/// same first moment: it brings a mass to where the jumps within that step would, and has a
/// derivative by the delay.
class CommandPath {
 public:
  /// One position, and what it changes with.
  struct Sample {
    double q = std::numeric_limits<double>::quiet_NaN();  ///< [rad] or [m]; NaN: the drive is off
    double by_delay = 0.0;                                ///< over the delay [rad/s] or [m/s]
    double by_speed = 0.0;  ///< over the largest speed [s]
  };

  CommandPath() = default;
  /// @param time  (N) [s], ascending  @param q  (N, n) [rad] or [m]; NaN: off
  /// @param gain  (n) of the run's drives, in the unit of the model's
  CommandPath(std::vector<double> time, RowMatX<double> q, VecX<double> gain)
      : time_(std::move(time)),
        is_on_(q.array() == q.array()),
        told_(std::move(q)),
        way_(static_cast<std::size_t>(told_.size())),
        gain_(std::move(gain)) {
    // While it is off, a drive keeps its last command; before the first one, that.
    for (long j = 0; j < told_.cols(); ++j) {
      for (long k = 1; k < told_.rows(); ++k)
        if (!is_on_(k, j)) told_(k, j) = told_(k - 1, j);
      for (long k = told_.rows() - 1; k-- > 0;)
        if (!(told_(k, j) == told_(k, j))) told_(k, j) = told_(k + 1, j);
    }
  }

  /// Appends channels that are told what these joints are, at speeds of their own.
  void add_copies(const std::vector<int>& joints) {
    const long n = told_.cols(), more = static_cast<long>(joints.size());
    if (more == 0) return;
    told_.conservativeResize(Eigen::NoChange, n + more);
    is_on_.conservativeResize(Eigen::NoChange, n + more);
    gain_.conservativeResize(n + more);
    for (long k = 0; k < more; ++k) {
      const int joint = joints[static_cast<std::size_t>(k)];
      told_.col(n + k) = told_.col(joint);
      is_on_.col(n + k) = is_on_.col(joint);
      gain_[n + k] = gain_[joint];
    }
    std::vector<Way> ways(static_cast<std::size_t>(told_.size()));
    for (long row = 0; row < told_.rows(); ++row)
      for (long k = 0; k < n + more; ++k)
        ways[static_cast<std::size_t>(row * (n + more) + k)] = way_[static_cast<std::size_t>(
            row * n + (k < n ? k : joints[static_cast<std::size_t>(k - n)]))];
    way_ = std::move(ways);
  }

  /// Gain of the run's drive, as its sidecar has it; 1 where nothing is said.
  double gain(int joint) const { return gain_[joint]; }

  /// Lets a joint's command move at most so fast [rad/s] or [m/s], as a drive does that leads its
  /// setpoint from where it is to where it is told. It begins at the first command.
  void limit_speed(int joint, double speed) {
    if (told_.rows() == 0) return;
    double setpoint = told_(0, joint), by_speed = 0.0;  // where the period begins
    for (long k = 0; k < told_.rows(); ++k) {
      const double left = told_(k, joint) - setpoint;
      const double takes = speed > 0.0 ? std::abs(left) / speed : period(k);
      const double side = left > 0.0 ? 1.0 : -1.0;
      way(k, joint) = {takes, side * speed, by_speed, side};
      if (takes > period(k)) {
        setpoint += side * speed * period(k);
        by_speed += side * period(k);
      } else {
        setpoint = told_(k, joint);
        by_speed = 0.0;
      }
    }
  }

  /// Command of a delay ago [s], which a drive acts on at a time [s] unless it is off in that step.
  /// The first and the last one hold beyond the ends.
  Sample at(int joint, double time, double delay, const SimulationStep& step = {}) const {
    if (time_.empty()) return {};
    const double h = step.to - step.from;
    const bool instant = !(h > 0.0);
    if (!is_on_(row(instant ? time : 0.5 * (step.from + step.to)), joint)) return {};
    if (instant) {
      const Setpoint c = setpoint(row(time - delay), joint, time - delay);
      return {c.q, 0.0, c.by_speed};
    }
    const double from = step.from - delay, to = step.to - delay, middle = 0.5 * (from + to);
    Setpoint area, moment;  // ∫ c dt, ∫ (t − middle) c dt
    long k = row(from);
    const double first = setpoint(k, joint, from).q;
    for (double begin = from; begin < to; ++k) {
      const double end =
          k + 1 < told_.rows() ? std::min(to, time_[static_cast<std::size_t>(k + 1)]) : to;
      const double arrival = time_[static_cast<std::size_t>(k)] + way(k, joint).takes;
      const double stop = std::clamp(arrival, begin, end);
      add(k, joint, begin, stop, middle, area, moment);
      add(k, joint, stop, end, middle, area, moment);
      begin = end;
    }
    const double last = setpoint(k - 1, joint, to).q;
    const double x = time - delay - middle, slope = 12.0 * x / (h * h * h);
    const double by_delay = -(last - first) / h - slope * (0.5 * h * (first + last) - area.q);
    return {area.q / h + slope * moment.q, by_delay, area.by_speed / h + slope * moment.by_speed};
  }

 private:
  /// How the setpoint goes to what it is told in one row.
  struct Way {
    double takes = 0.0;     ///< time until it is there [s]
    double rate = 0.0;      ///< until then [rad/s] or [m/s]
    double by_speed = 0.0;  ///< derivative over the speed where the row begins [s]
    double side = 0.0;      ///< sign of the rate
  };
  /// Setpoint, or an integral of it, and its derivative over the speed.
  struct Setpoint {
    double q = 0.0, by_speed = 0.0;
  };

  Way& way(long k, long joint) { return way_[static_cast<std::size_t>(k * told_.cols() + joint)]; }
  const Way& way(long k, long joint) const {
    return way_[static_cast<std::size_t>(k * told_.cols() + joint)];
  }

  /// Setpoint at a time of row k; before the first row, its first one.
  Setpoint setpoint(long k, int joint, double t) const {
    const Way& w = way(k, joint);
    const double since = std::max(t - time_[static_cast<std::size_t>(k)], 0.0);
    if (!(since < w.takes)) return {told_(k, joint), 0.0};
    return {told_(k, joint) - w.rate * (w.takes - since), w.by_speed + w.side * since};
  }

  /// Adds the integrals of a stretch of row k in which the setpoint is straight.
  void add(long k, int joint, double from, double to, double middle, Setpoint& area,
           Setpoint& moment) const {
    const double h = to - from;
    if (!(h > 0.0)) return;
    const double centre = 0.5 * (from + to);
    const Setpoint c = setpoint(k, joint, centre);
    const Way& w = way(k, joint);
    area.q += h * c.q;
    area.by_speed += h * c.by_speed;
    moment.q += h * (centre - middle) * c.q;
    moment.by_speed += h * (centre - middle) * c.by_speed;
    const double since = centre - time_[static_cast<std::size_t>(k)];
    if (!(since > 0.0 && since < w.takes)) return;  // before the first row, no command leads
    moment.q += h * h * h / 12.0 * w.rate;
    moment.by_speed += h * h * h / 12.0 * w.side;
  }

  /// Row whose command holds at a time, the first one before them all: that where it would be if
  /// rows were even, or next to it; else searched for.
  long row(double t) const {
    const long last = static_cast<long>(time_.size()) - 1;
    const auto is_it = [&](long k) {
      return time_[static_cast<std::size_t>(k)] <= t &&
             (k == last || t < time_[static_cast<std::size_t>(k + 1)]);
    };
    if (!(t > time_.front())) return 0;
    if (t >= time_.back()) return last;
    const double share = (t - time_.front()) / (time_.back() - time_.front());
    const long even = static_cast<long>(share * static_cast<double>(last));
    for (const long k : {even, even + 1, even - 1})
      if (k >= 0 && k <= last && is_it(k)) return k;
    return std::upper_bound(time_.begin(), time_.end(), t) - time_.begin() - 1;
  }

  /// Time that the command of row k is held [s].
  double period(long k) const {
    if (time_.size() < 2) return 0.0;
    const std::size_t from = std::min(static_cast<std::size_t>(k), time_.size() - 2);
    return time_[from + 1] - time_[from];
  }

  std::vector<double> time_;
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> is_on_;
  RowMatX<double> told_;  ///< (N, n)
  std::vector<Way> way_;  ///< (N, n)
  VecX<double> gain_;
};

}  // namespace diffnea
