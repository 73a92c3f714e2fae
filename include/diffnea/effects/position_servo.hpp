#pragma once

#include <cmath>

#include <diffnea/effects/command.hpp>
#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// position_servo: the drive follows a commanded position by itself, and no torque is logged. It
/// leads its setpoint c to what it is told at no more than its speed. Its controller acts on
/// s (c(t − d) − q), s the gain that the run's sidecar has (`controller.JOINT.gain`, 1 where there
/// is none); nothing within the dead band, and no more than at its reach, where the duty saturates.
/// While it is on, the motor brakes in proportion to its speed (back-EMF, and what the firmware
/// adds). Without delay, dead band and bounds it is MuJoCo's `position` actuator.
struct PositionServo {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "position_servo",
        .formula = "-(K clip(dead(s (c(t - d) - q), e0), reach) - B qd), |dc/dt| <= speed",
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
              .initial = 1e3},
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
              .initial = kJumps}},
        .motor_side = true,
        .traits = {Trait::kOfDrive, Trait::kReadsCommand, Trait::kIfAsked},
        .shown_over = {ShownOver::kTime, ShownOver::kVelocity}};
    return kInfo;
  }

  /// Speed at which a setpoint jumps [rad/s] or [m/s]: at it a step would still take a millisecond.
  static constexpr double kJumps = 1e3;

  /// Lets the setpoint move no faster than its speed, if it has one.
  static void lead(int joint, const double* p, CommandPath& path) {
    if (p[5] < kJumps) path.limit_speed(joint, p[5]);
  }

  /// Largest slope of the torque over the error, wherever the drive is.
  static double slope(int joint, const double* p, const CommandPath& path) {
    return p[0] * path.gain(joint);
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    if constexpr (requires { value_part(p[2]); }) {  // packs follow no command
      if (!x.command) return;
      const int j = *joint;
      if (!x.command->is_on(j, x.time, x.step)) return;
      const T& read = x.q[x.encoder < 0 ? j : x.encoder];
      const T gain(x.command->gain(j));
      const T error = x.command->made_of(j, x.time, p[2], p[5], x.step, [&](const T& command) {
        const T e = gain * (command - read);
        const T out = e - select(e > p[4], p[4], select(e < -p[4], T(-p[4]), e));
        return select(out > p[3], p[3], select(out < -p[3], T(-p[3]), out));
      });
      tau[j] += p[1] * x.qd[j] - p[0] * error;
    }
  }
};

}  // namespace diffnea
