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
        .parameters = {{.name = "stiffness",
                        .unit = "N*m/rad",
                        .unit_prismatic = "N/m",
                        .sign = Sign::kNonNegative},
                       {.name = "damping",
                        .unit = "N*m*s/rad",
                        .unit_prismatic = "N*s/m",
                        .sign = Sign::kNonNegative},
                       {.name = "delay",
                        .unit = "s",
                        .unit_prismatic = "s",
                        .linear = false,
                        .initial = 0.0},
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
                        .initial = 1e3}},
        .motor_side = true,
        .traits = {Trait::kOfDrive, Trait::kReadsCommand, Trait::kIfAsked},
        .shown_over = {ShownOver::kTime, ShownOver::kVelocity}};
    return kInfo;
  }

  /// Lets the setpoint move no faster than its speed.
  static void lead(int joint, const double* p, CommandPath& path) { path.limit_speed(joint, p[5]); }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    if constexpr (requires { value_part(p[2]); }) {  // packs follow no command
      if (!x.command) return;
      const int j = *joint;
      const double delay = value_part(p[2]);
      const CommandPath::Sample c = x.command->at(j, x.time, delay, x.step);
      if (!(c.q == c.q)) return;  // switched off
      // c has the delay p[2] and the speed p[5] (led); T may be a Jet.
      const T command =
          T(c.q) + T(c.by_delay) * (p[2] - T(delay)) + T(c.by_speed) * (p[5] - T(value_part(p[5])));
      const T& read = x.q[x.encoder < 0 ? j : x.encoder];
      T error = T(x.command->gain(j)) * (command - read);
      const T dead = select(error > p[4], p[4], select(error < -p[4], T(-p[4]), error));
      error = error - dead;
      error = select(error > p[3], p[3], select(error < -p[3], T(-p[3]), error));
      tau[j] += p[1] * x.qd[j] - p[0] * error;
    }
  }
};

}  // namespace diffnea
