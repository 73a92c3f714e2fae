#pragma once

#include <diffnea/effects/position_servo.hpp>

namespace diffnea {

/// supply_sag: the drive that follows commands is a voltage behind a DC motor, and its supply
/// falls under load, or with its battery. Its controller sets a duty; the motor sees duty times
/// supply, and pulls in proportion to that (the braking by back-EMF is the drive's damping, which
/// no supply changes). The recording has the supply as a channel; without one nothing changes. A
/// drive whose current is controlled does not follow it: its share is 0.
struct SupplySag {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "supply_sag",
        .formula = "-share (V/V0 - 1) K clip(dead(s (c(t - d) - q), e0), reach)",
        .summary = "torque of a drive that follows its supply voltage",
        .place = Place::kJoint,
        .parameters = {{.name = "share",
                        .unit = "1",
                        .unit_prismatic = "1",
                        .sign = Sign::kNonNegative,
                        .linear = false,
                        .initial = 1.0,
                        .search = {1.0}},
                       {.name = "nominal",
                        .unit = "V",
                        .unit_prismatic = "V",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 12.0}},
        .motor_side = true,
        .traits = {Trait::kOfDrive, Trait::kOfServo, Trait::kReadsSupply, Trait::kAtMotor,
                   Trait::kIfAsked},
        .shown_over = {ShownOver::kTime, ShownOver::kVelocity}};
    return kInfo;
  }

  /// Lets the drive of the joint follow its supply.
  static void lead(int joint, const double* p, CommandPath& path) {
    path.follow_supply(joint, p[0], p[1]);
  }

  /// Adds nothing but the derivative by the share: the drive itself has the torque, by lead(), so
  /// that derivatives by its own parameters are those of a drive whose supply sags.
  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    if constexpr (requires { p[0].v; }) {
      const int j = *joint;
      if (!x.command || !x.command->is_on(j, x.time, x.step)) return;
      const int integrator = x.command->integrator(j);
      const double integral =
          integrator < 0 ? 0.0 : x.command->integral_rate(j) * value_part(x.qd[integrator]);
      const double* servo = x.command->servo(j);
      const double pull = PositionServo::pull(*x.command, j, x.time, x.step,
                                              value_part(x.q[x.encoder < 0 ? j : x.encoder]),
                                              integral - servo[6] * value_part(x.qd[j]), servo);
      tau[j] += (T(p[0].a) - p[0]) * T(x.command->sag(j, x.time) * pull);
    }
  }
};

}  // namespace diffnea
