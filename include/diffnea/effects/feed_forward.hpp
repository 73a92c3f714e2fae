#pragma once

#include <diffnea/effects/command.hpp>
#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// feed_forward: the drive that follows commands is told a velocity and a torque beside each
/// position, and adds them to what its position loop asks for. With the braking of its
/// position_servo for the second gain that is the impedance law of most drives of legged robots,
/// K (q_c - q) + B (q̇_c - q̇) + τ_c (MIT mode: Katz 2018). Commands act as late as positions do.
struct FeedForward {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "feed_forward",
        .formula = "-(Bc cd(t - d) + g tc(t - d))",
        .summary = "velocity and torque that a drive is told beside its position",
        .place = Place::kJoint,
        .parameters =
            {{.name = "damping",
              .unit = "N*m*s/rad",
              .unit_prismatic = "N*s/m",
              .sign = Sign::kNonNegative},
             {.name = "share", .unit = "1", .unit_prismatic = "1", .sign = Sign::kNonNegative}},
        .motor_side = true,
        .traits = {Trait::kOfDrive, Trait::kOfServo, Trait::kFedForward, Trait::kAtMotor,
                   Trait::kIfAsked},
        .shown_over = {ShownOver::kTime, ShownOver::kVelocity}};
    return kInfo;
  }

  /// Tells the joint's drive what its delay acts on.
  static void lead(int joint, const double* p, CommandPath& path) {
    path.feed_forward(joint, p[0], p[1]);
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    if constexpr (requires { value_part(p[0]); }) {  // packs follow no command
      const int j = *joint;
      if (!x.command || !x.command->is_on(j, x.time, x.step)) return;
      const T delay(x.command->servo(j)[2]);
      tau[j] -= x.command->fed(j, x.time, delay, x.step, p[0], p[1]);
    }
  }
};

}  // namespace diffnea
