#pragma once
/// Commanded positions of one run over time: what a drive with a position loop of its own reads.

#include <algorithm>
#include <array>
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

/// A drive holds each command until the next one, and is off in rows without one (NaN). What it
/// makes of them over a step of a simulation is taken as the straight line with the same mean and
/// the same first moment: it brings a mass to where the jumps within that step would, and has a
/// derivative by the delay. Bounds of the drive act on each command: they do not commute with the
/// mean.
class CommandPath {
 public:
  CommandPath() = default;
  /// @param time  (N) [s], ascending  @param q  (N, n) [rad] or [m]; NaN: off
  /// @param gain  (n) of the run's drives, in the unit of the model's
  CommandPath(std::vector<double> time, RowMatX<double> q, VecX<double> gain)
      : time_(std::move(time)),
        is_on_(q.array() == q.array()),
        told_(std::move(q)),
        way_(static_cast<std::size_t>(told_.size())),
        laws_(static_cast<std::size_t>(told_.cols())),
        gain_(std::move(gain)) {
    // While it is off, a drive keeps its last command; before the first one, that.
    for (long j = 0; j < told_.cols(); ++j) {
      for (long k = 1; k < told_.rows(); ++k)
        if (!is_on_(k, j)) told_(k, j) = told_(k - 1, j);
      for (long k = told_.rows() - 1; k-- > 0;)
        if (!(told_(k, j) == told_(k, j))) told_(k, j) = told_(k + 1, j);
    }
  }

  /// Commands of some joints alone. @param first  of `count` joints
  CommandPath of_joints(int first, int count) const {
    if (first == 0 && count == told_.cols()) return *this;
    CommandPath out;
    out.time_ = time_;
    out.is_on_ = is_on_.middleCols(first, count);
    out.told_ = told_.middleCols(first, count);
    if (supply_.size() > 0) out.supply_ = supply_.middleCols(first, count);
    if (velocity_.size() > 0) out.velocity_ = velocity_.middleCols(first, count);
    if (torque_.size() > 0) out.torque_ = torque_.middleCols(first, count);
    for (long k = 0; k < told_.rows(); ++k)
      out.way_.insert(out.way_.end(), &way(k, first), &way(k, first) + count);
    out.laws_.assign(laws_.begin() + first, laws_.begin() + first + count);
    out.gain_ = gain_.segment(first, count);
    return out;
  }

  /// Adds the logged supply of the drives. Gaps are filled along straight lines.
  /// @param volts  (N, n) [V]; NaN: a gap, or a joint whose supply was not logged
  void set_supply(RowMatX<double> volts) {
    supply_ = std::move(volts);
    for (long j = 0; j < supply_.cols(); ++j) {
      long last = -1;  // row with a value
      for (long k = 0; k < supply_.rows(); ++k) {
        if (!(supply_(k, j) == supply_(k, j))) continue;
        for (long g = last + 1; g < k; ++g)
          supply_(g, j) = last < 0 ? supply_(k, j)
                                   : supply_(last, j) + (supply_(k, j) - supply_(last, j)) *
                                                            passed(last, g) / passed(last, k);
        last = k;
      }
      for (long g = last + 1; last >= 0 && g < supply_.rows(); ++g)
        supply_(g, j) = supply_(last, j);
    }
  }

  /// Adds what the drives were told beside positions, held like these.
  /// @param velocity  (N, n) [rad/s] or [m/s]  @param torque  (N, n) [N·m] or [N]; NaN: none;
  /// either may be empty
  void set_feed_forward(RowMatX<double> velocity, RowMatX<double> torque) {
    const auto without_gaps = [](const RowMatX<double>& x) -> RowMatX<double> {
      return (x.array() == x.array()).select(x, 0.0);
    };
    velocity_ = without_gaps(velocity);
    torque_ = without_gaps(torque);
  }
  /// Tells whether a drive was ever told a velocity.
  bool has_velocity(int joint) const {
    return velocity_.size() > 0 && !velocity_.col(joint).isZero(0.0);
  }
  /// Tells whether a drive was ever told a torque.
  bool has_torque(int joint) const { return torque_.size() > 0 && !torque_.col(joint).isZero(0.0); }
  /// Sets what a joint's drive makes of them. @param damping, share  as feed_forward has them
  void feed_forward(int joint, double damping, double share) {
    law(joint).damping = damping;
    law(joint).fed_share = share;
  }

  /// Supply of a joint's drive [V], a straight line between two rows; NaN: it was not logged.
  double supply(int joint, double time) const {
    if (supply_.size() == 0) return std::numeric_limits<double>::quiet_NaN();
    const long k = row(time), next = std::min(k + 1, supply_.rows() - 1);
    const double since = std::max(time - time_[static_cast<std::size_t>(k)], 0.0);
    if (next == k) return supply_(k, joint);
    return supply_(k, joint) +
           (supply_(next, joint) - supply_(k, joint)) * std::min(since / passed(k, next), 1.0);
  }

  /// Keeps what a joint's drive is in this run, for effects that change its law.
  /// @param p  parameters of position_servo
  void set_servo(int joint, const double* p) { std::copy_n(p, kServo, law(joint).servo.begin()); }
  /// Parameters that set_servo() had; zeros: no drive.
  const double* servo(int joint) const { return law(joint).servo.data(); }

  /// Lets a share of the torque of a joint's drive follow its supply.
  /// @param nominal  supply at which it has the gain of the model [V]
  void follow_supply(int joint, double share, double nominal) {
    law(joint).share = share;
    law(joint).nominal = nominal;
  }
  /// Supply over the nominal one, less 1; 0 where nothing was logged, or no torque follows it.
  double sag(int joint, double time) const {
    const double nominal = law(joint).nominal,
                 volts = nominal > 0.0 ? supply(joint, time) : nominal;
    return volts > 0.0 ? volts / nominal - 1.0 : 0.0;
  }
  /// Torque of a joint's drive over that at its nominal supply.
  double strength(int joint, double time) const {
    return 1.0 + law(joint).share * sag(joint, time);
  }

  /// Gives the drive of a joint an integrator: a degree of freedom whose velocity is the integral
  /// of the drive's error.
  void set_integrator(int joint, int dof) {
    law(joint).integrator = dof;
    law(dof).sums = joint;
  }
  /// Degree of freedom that integrates the error of a joint's drive; −1: none.
  int integrator(int joint) const { return law(joint).integrator; }
  /// Joint whose drive's error a degree of freedom integrates; −1: it is no integrator.
  int sums(int dof) const { return law(dof).sums; }
  /// Sets what the integral counts beside the error [1/s].
  void set_integral_rate(int joint, double rate) { law(joint).rate = rate; }
  /// Value that set_integral_rate() had, or 0 [1/s].
  double integral_rate(int joint) const { return law(joint).rate; }

  /// Appends channels that are told what these joints are, at speeds of their own.
  void add_copies(const std::vector<int>& joints) {
    const long n = told_.cols(), more = static_cast<long>(joints.size());
    if (more == 0) return;
    for (RowMatX<double>* logged : {&supply_, &velocity_, &torque_}) {
      if (logged->size() == 0) continue;
      logged->conservativeResize(Eigen::NoChange, n + more);
      for (long k = 0; k < more; ++k)
        logged->col(n + k) = logged->col(joints[static_cast<std::size_t>(k)]);
    }
    laws_.resize(static_cast<std::size_t>(n + more));
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

  /// Command of a delay ago [s], which a drive acts on at a time [s]: [rad] or [m], NaN if it is
  /// off then. The first and the last one hold beyond the ends.
  double at(int joint, double time, double delay) const {
    if (!is_on(joint, time, {})) return std::numeric_limits<double>::quiet_NaN();
    return setpoint(row(time - delay), joint, time - delay).q;
  }

  /// Tells whether the drive is on at a time [s], or in the middle of the step that it lies in.
  bool is_on(int joint, double time, const SimulationStep& step) const {
    if (time_.empty()) return false;
    return is_on_(row(step.to > step.from ? 0.5 * (step.from + step.to) : time), joint);
  }

  /// Value that a drive that is on makes of its commands at a time of a step, as said above; at an
  /// instant, without a derivative by the delay.
  /// @param time   [s], within the step, if there is one
  /// @param delay  of the commands [s]
  /// @param speed  that limit_speed() had
  /// @param law    what the drive makes of one setpoint [rad] or [m], told in a row: (T, long) -> T
  template <Scalar T, class Law>
  T made_of(int joint, double time, const T& delay, const T& speed, const SimulationStep& step,
            const Law& law) const {
    const double late = value_part(delay), h = step.to - step.from;
    const auto of = [&](const Setpoint& c) {
      return T(law(T(c.q) + T(c.by_speed) * (speed - T(value_part(speed))), c.row));
    };
    if (!(h > 0.0)) return of(setpoint(row(time - late), joint, time - late));
    const double from = step.from - late, to = step.to - late, middle = 0.5 * (from + to);
    long k = row(from);
    // A command that comes as the step begins: were it later, the one before would count.
    if (k > 0 && time_[static_cast<std::size_t>(k)] == from) --k;
    const T first = of(setpoint(k, joint, from));
    if (!(end_of(k, to) < to) && arrival(k, joint) <= from) return first;  // one command
    T area(0.0), moment(0.0);  // ∫ law dt, ∫ (t − middle) law dt
    for (double begin = from; begin < to; ++k) {
      const double end = end_of(k, to), stop = std::clamp(arrival(k, joint), begin, end);
      // Two points of Gauss's make the moment of a straight line exact.
      const double centre = 0.5 * (begin + stop), off = (stop - begin) / std::sqrt(12.0);
      for (const double t : {centre - off, centre + off})
        if (stop > begin)
          add(of(setpoint(k, joint, t)), 0.5 * (stop - begin), t - middle, area, moment);
      if (end > stop)
        add(of(setpoint(k, joint, end)), end - stop, 0.5 * (stop + end) - middle, area, moment);
      begin = end;
    }
    const T last = of(setpoint(k - 1, joint, to));
    const double slope = 12.0 * (time - late - middle) / (h * h * h);
    const T by_delay =
        T(-1.0 / h) * (last - first) - T(slope) * (T(0.5 * h) * (first + last) - area);
    return T(1.0 / h) * area + T(slope) * moment + T(value_part(by_delay)) * (delay - T(late));
  }

  /// Torque that a drive makes of the velocity and the torque it is told, by these gains.
  template <Scalar T>
  T fed(int joint, double time, const T& delay, const SimulationStep& step, const T& damping,
        const T& share) const {
    return made_of(joint, time, delay, T(0.0), step, [&](const T&, long row) {
      T out(0.0);
      if (velocity_.size() > 0) out = out + damping * T(velocity_(row, joint));
      if (torque_.size() > 0) out = out + share * T(torque_(row, joint));
      return out;
    });
  }
  /// The same by the gains that feed_forward() had.
  template <Scalar T>
  T fed(int joint, double time, const T& delay, const SimulationStep& step) const {
    return fed(joint, time, delay, step, T(law(joint).damping), T(law(joint).fed_share));
  }
  /// Tells whether feed_forward() had gains other than 0.
  bool is_fed(int joint) const { return law(joint).damping != 0.0 || law(joint).fed_share != 0.0; }

 private:
  /// How the setpoint goes to what it is told in one row.
  struct Way {
    double takes = 0.0;     ///< time until it is there [s]
    double rate = 0.0;      ///< until then [rad/s] or [m/s]
    double by_speed = 0.0;  ///< derivative over the speed where the row begins [s]
    double side = 0.0;      ///< sign of the rate
  };
  /// Setpoint and its derivative over the speed.
  struct Setpoint {
    double q = 0.0, by_speed = 0.0;
    long row = 0;  ///< in which it was told
  };
  static constexpr std::size_t kServo = 7;  ///< parameters of position_servo
  /// Law of a joint's drive.
  struct Law {
    std::array<double, kServo> servo{};
    double share = 0.0;    ///< part of its torque that follows the supply
    double nominal = 0.0;  ///< supply [V]
    int integrator = -1;   ///< degree of freedom
    int sums = -1;         ///< joint, of an integrator
    double rate = 0.0;     ///< weight of the integral [1/s]
    double damping = 0.0, fed_share = 0.0;  ///< gains of feed_forward
  };

  Law& law(int joint) { return laws_[static_cast<std::size_t>(joint)]; }
  const Law& law(int joint) const { return laws_[static_cast<std::size_t>(joint)]; }
  /// Time from one row to another [s].
  double passed(long from, long to) const {
    return time_[static_cast<std::size_t>(to)] - time_[static_cast<std::size_t>(from)];
  }

  Way& way(long k, long joint) { return way_[static_cast<std::size_t>(k * told_.cols() + joint)]; }
  const Way& way(long k, long joint) const {
    return way_[static_cast<std::size_t>(k * told_.cols() + joint)];
  }

  /// Setpoint at a time of row k; before the first row, its first one.
  Setpoint setpoint(long k, int joint, double t) const {
    const Way& w = way(k, joint);
    const double since = std::max(t - time_[static_cast<std::size_t>(k)], 0.0);
    if (!(since < w.takes)) return {told_(k, joint), 0.0, k};
    return {told_(k, joint) - w.rate * (w.takes - since), w.by_speed + w.side * since, k};
  }

  /// Adds what a value of some duration [s], so long after the middle [s], has of both integrals.
  template <class T>
  static void add(const T& value, double duration, double after, T& area, T& moment) {
    area = area + T(duration) * value;
    moment = moment + T(duration * after) * value;
  }

  /// Time at which row k ends, and no later than that given [s].
  double end_of(long k, double latest) const {
    return k + 1 < told_.rows() ? std::min(latest, time_[static_cast<std::size_t>(k + 1)]) : latest;
  }

  /// Time from which on the setpoint is what row k tells [s].
  double arrival(long k, int joint) const {
    return time_[static_cast<std::size_t>(k)] + way(k, joint).takes;
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
  RowMatX<double> told_;    ///< (N, n)
  RowMatX<double> supply_;  ///< (N, n) [V]; empty: not logged
  RowMatX<double> velocity_, torque_;  ///< (N, n) told beside told_; empty: none
  std::vector<Way> way_;    ///< (N, n)
  std::vector<Law> laws_;   ///< (n)
  VecX<double> gain_;
};

}  // namespace diffnea
