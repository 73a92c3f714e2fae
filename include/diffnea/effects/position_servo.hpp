#pragma once

#include <cmath>

#include <diffnea/effects/command.hpp>
#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// position_servo: the drive follows a commanded position by itself, and no torque is logged. It
/// leads its setpoint c to what it is told at no more than its speed. Its controller acts on
/// s (c(t − d) − q), s the gain that the run's sidecar has (`controller.JOINT.gain`, 1 where there
/// is none); nothing within the dead band, and no more than at its reach, where the duty saturates.
/// While it is on, it brakes in proportion to its speed: the motor by its back-EMF, beyond that
/// bound, and the firmware by a derivative time D (Åström, Hägglund 1995), within it. Without
/// delay and dead band, and with B = K D, it is MuJoCo's `position` actuator.
struct PositionServo {
  /// Reach of a drive that has none [rad] or [m].
  static constexpr double kNoReach = 1e3;

  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "position_servo",
        .formula =
            "-(K clip(dead(s (c(t - d) - q), e0) - D qd, reach) - (B - K D) qd), "
            "|dc/dt| <= speed",
        .summary = "drive that follows a commanded position by itself",
        .place = Place::kJoint,
        .parameters =
            {{.name = "stiffness",
              .unit = "N*m/rad",
              .unit_prismatic = "N/m",
              .sign = Sign::kNonNegative},
             {.name = "damping",
              .unit = "N*m*s/rad",
              .unit_prismatic = "N*s/m",
              .sign = Sign::kNonNegative},
             {.name = "delay", .unit = "s", .unit_prismatic = "s", .linear = false, .initial = 0.0},
             {.name = "reach",
              .unit = "rad",
              .unit_prismatic = "m",
              .sign = Sign::kPositive,
              .linear = false,
              .initial = kNoReach},
             {.name = "dead_band",
              .unit = "rad",
              .unit_prismatic = "m",
              .sign = Sign::kNonNegative,
              .linear = false,
              .initial = 0.0},
             {.name = "speed",
              .unit = "rad/s",
              .unit_prismatic = "m/s",
              .sign = Sign::kPositive,
              .linear = false,
              .initial = kJumps},
             {.name = "derivative_time",
              .unit = "s",
              .unit_prismatic = "s",
              .sign = Sign::kNonNegative,
              .linear = false,
              .initial = 0.0}},
        .motor_side = true,
        .traits = {Trait::kOfDrive, Trait::kReadsCommand, Trait::kIfAsked},
        .shown_over = {ShownOver::kTime, ShownOver::kVelocity}};
    return kInfo;
  }

  /// Speed at which a setpoint jumps [rad/s] or [m/s]: at it a step would still take a millisecond.
  static constexpr double kJumps = 1e3;

  /// Lets the setpoint move no faster than its speed, if it has one.
  static void lead(int joint, const double* p, CommandPath& path) {
    path.set_servo(joint, p);
    if (p[5] < kJumps) path.limit_speed(joint, p[5]);
  }

  /// Tells whether its torque has corners over the error: a reach, a dead band.
  static bool has_bounds(const double* p) { return p[3] < kNoReach || p[4] > 0.0; }

  /// Largest slope of the torque over the error, wherever the drive is, at its nominal supply; of
  /// its integrator, that of its acceleration.
  static double slope(int joint, const double* p, const CommandPath& path) {
    return path.sums(joint) < 0 ? p[0] * path.gain(joint) : path.gain(path.sums(joint));
  }

  /// Error beyond the dead band, and what is added to it.
  template <Scalar T>
  static T asked(const T& error, const T& more, const T* p) {
    return error - select(error > p[4], p[4], select(error < -p[4], T(-p[4]), error)) + more;
  }

  /// Torque towards the command of a drive that is on, at its nominal supply and without braking.
  /// @param read  position that it is fed back
  /// @param more  what its integrator and its derivative time add to the error
  template <Scalar T>
  static T pull(const CommandPath& command, int joint, double time, const SimulationStep& step,
                const T& read, const T& more, const T* p) {
    const T gain(command.gain(joint));
    return p[0] * command.made_of(joint, time, p[2], p[5], step, [&](const T& told, long) {
      const T out = asked(T(gain * (told - read)), more, p);
      return select(out > p[3], p[3], select(out < -p[3], T(-p[3]), out));
    });
  }

  /// Rate of its integrator: the error. While error and integral saturate the drive, none that
  /// would drive it on (anti-windup by clamping; Åström, Hägglund 1995).
  template <Scalar T>
  static T summed(const CommandPath& command, int joint, double time, const SimulationStep& step,
                  const T& read, const T& integral, const T* p) {
    const T gain(command.gain(joint));
    return command.made_of(joint, time, p[2], p[5], step, [&](const T& told, long) {
      const T error = gain * (told - read), out = asked(error, integral, p);
      const bool on = value_part(out) * value_part(error) > 0.0;
      return on && (out > p[3] || out < -p[3]) ? T(0.0) : error;
    });
  }

  /// Derivative by the delay of what feed_forward adds; its value is 0.
  template <Scalar T>
  static T by_delay_of_the_rest(const JointSample<T>& x, int joint, const T& delay) {
    if constexpr (requires { delay.v; })
      if (x.command->is_fed(joint)) {
        const T fed = x.command->fed(joint, x.time, delay, x.step);
        return fed - T(value_part(fed));
      }
    return T(0.0);
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    if constexpr (requires { value_part(p[2]); }) {  // packs follow no command
      if (!x.command) return;
      const int sums = x.command->sums(*joint), j = sums < 0 ? *joint : sums;
      if (!x.command->is_on(j, x.time, x.step)) return;
      const T& read = x.q[x.encoder < 0 ? j : x.encoder];
      const int integrator = x.command->integrator(j);
      const T integral =
          integrator < 0 ? T(0.0) : T(T(x.command->integral_rate(j)) * x.qd[integrator]);
      if (sums < 0)
        tau[j] += (p[1] - p[0] * p[6]) * x.qd[j] - by_delay_of_the_rest(x, j, p[2]) -
                  T(x.command->strength(j, x.time)) *
                      pull(*x.command, j, x.time, x.step, read, T(integral - p[6] * x.qd[j]), p);
      else  // its inertia is 1: this is its acceleration
        tau[*joint] -= summed(*x.command, j, x.time, x.step, read, integral, p);
    }
  }
};

}  // namespace diffnea
