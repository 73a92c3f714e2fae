#pragma once
/// Commanded positions of one run over time: what a drive with a position loop of its own reads.

#include <algorithm>
#include <limits>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Straight lines between the rows of a log. What holds each command for a period lags them by half
/// of it, which is part of a drive's delay. Where no position was commanded (NaN) the drive is off.
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
        q_(std::move(q)),
        by_speed_(RowMatX<double>::Zero(q_.rows(), q_.cols())),
        gain_(std::move(gain)) {}

  /// Gain of the run's drive, as its sidecar has it; 1 where nothing is said.
  double gain(int joint) const { return gain_[joint]; }

  /// Lets a joint's command move at most so fast [rad/s] or [m/s], as a drive does that leads its
  /// setpoint from where it is to where it is told. It begins at the first command.
  void limit_speed(int joint, double speed) {
    for (long k = 1; k < q_.rows(); ++k) {
      const double h = time_[static_cast<std::size_t>(k)] - time_[static_cast<std::size_t>(k - 1)];
      const double step = q_(k, joint) - q_(k - 1, joint);  // NaN: switched on or off
      if (!(std::abs(step) > speed * h)) continue;
      const double sign = step > 0.0 ? 1.0 : -1.0;
      q_(k, joint) = q_(k - 1, joint) + sign * speed * h;
      by_speed_(k, joint) = by_speed_(k - 1, joint) + sign * h;
    }
  }

  /// The command of a joint at a time [s]; the first and the last one hold beyond the ends.
  Sample at(int joint, double time) const {
    if (time_.empty()) return {};
    const auto next = std::upper_bound(time_.begin(), time_.end(), time);
    const long k = std::max<long>(next - time_.begin() - 1, 0);
    const Sample here{q_(k, joint), 0.0, by_speed_(k, joint)};
    if (next == time_.begin() || next == time_.end()) return here;
    const double from = time_[static_cast<std::size_t>(k)], h = *next - from;
    const double rate = (q_(k + 1, joint) - q_(k, joint)) / h;
    if (!(rate == rate)) return here;  // switched on or off within it
    return {here.q + rate * (time - from), rate,
            here.by_speed + (by_speed_(k + 1, joint) - here.by_speed) * (time - from) / h};
  }

 private:
  std::vector<double> time_;
  RowMatX<double> q_, by_speed_;
  VecX<double> gain_;
};

}  // namespace diffnea
