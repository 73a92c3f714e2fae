#pragma once

#include <array>

#include <diffnea/effects/position_servo.hpp>

namespace diffnea {

/// integral_action: the drive that follows commands adds the integral of its error to the error, so
/// that no load leaves one for good. Its state begins each run at 0; a torque that it held before
/// is the joint's offset. It stands still while the drive is off, and sums nothing up while the
/// drive saturates. A simulation gives it a degree of freedom (motion/hidden_rotors.hpp); without
/// one nothing is integrated.
struct IntegralAction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "integral_action",
        .formula =
            "-K (clip(dead(e) + rate int e dt, reach) - clip(dead(e), reach)), "
            "e = s (c(t - d) - q)",
        .summary = "integral of its error in the law of a drive",
        .place = Place::kJoint,
        .parameters = {{.name = "rate",
                        .unit = "1/s",
                        .unit_prismatic = "1/s",
                        .sign = Sign::kNonNegative,
                        .linear = false,
                        .initial = 1.0,
                        .search = {0.3, 1.0, 3.0, 10.0}}},
        .motor_side = true,
        .traits = {Trait::kOfDrive, Trait::kOfServo, Trait::kIntegrates, Trait::kAtMotor,
                   Trait::kIfAsked},
        .shown_over = {ShownOver::kTime, ShownOver::kPosition}};
    return kInfo;
  }

  /// Sets the rate of the joint's drive.
  static void lead(int joint, const double* p, CommandPath& path) {
    path.set_integral_rate(joint, p[0]);
  }

  /// Adds nothing but the derivative by the rate: the drive itself has the torque, by lead().
  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    if constexpr (requires { p[0].v; }) {
      const int j = *joint;
      if (!x.command || x.command->integrator(j) < 0 || !x.command->is_on(j, x.time, x.step))
        return;
      const double sum = value_part(x.qd[x.command->integrator(j)]);
      T integral(x.command->integral_rate(j) * sum);
      integral.v[0] = sum;
      std::array<T, 7> servo;
      for (std::size_t k = 0; k < servo.size(); ++k) servo[k] = T(x.command->servo(j)[k]);
      const T pull = PositionServo::pull(
          *x.command, j, x.time, x.step, T(value_part(x.q[x.encoder < 0 ? j : x.encoder])),
          T(integral - servo[6] * T(value_part(x.qd[j]))), servo.data());
      tau[j] += (T(p[0].a) - p[0]) * T(x.command->strength(j, x.time) * pull.v[0]);
    }
  }
};

}  // namespace diffnea
