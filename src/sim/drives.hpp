#pragma once
/// What stands between the commanded torque and the one that acts: a limit, a delay, a first-order
/// lag, in this order; and what the encoders make of the positions.

#include <deque>
#include <vector>

#include <diffnea/effects/stepping.hpp>

namespace diffnea::sim {

class Drives {
 public:
  /// Takes what has an `add_to_drive` from `effects`, leaves the others.
  Drives(const std::vector<BoundEffect>& effects, int num_dofs);

  void reset();
  /// Torque that is commanded from `time` [s] on. The first one counts as held since ever.
  void command(double time, const VecX<double>& torque);
  /// Begins a step of `h` seconds, within which the input of the lag counts as constant: as the mean
  /// of what was commanded a delay ago.
  void begin_step(double time, double h);
  /// Torque that acts after `share` of the step, (n); where a lag is over within it, its mean, which
  /// no few points of a step have.
  VecX<double> applied(double share) const;
  void end_step();

 private:
  struct Command {
    double time;
    VecX<double> torque;
  };
  VecX<double> limit_, delay_, lag_;
  std::deque<Command> commands_;
  VecX<double> input_, state_;
  double h_ = 0.0;
};

/// Encoders read (1 + ε) q + δ.
class Encoders {
 public:
  /// Takes what has an `add_to_encoder` from `effects`, leaves the others.
  Encoders(const std::vector<BoundEffect>& effects, int num_dofs);

  VecX<double> read(const VecX<double>& q) const { return q.cwiseProduct(gain_) + offset_; }
  VecX<double> read_velocity(const VecX<double>& qd) const { return qd.cwiseProduct(gain_); }
  VecX<double> truth(const VecX<double>& reading) const {
    return (reading - offset_).cwiseQuotient(gain_);
  }

 private:
  VecX<double> gain_, offset_;
};

}  // namespace diffnea::sim
