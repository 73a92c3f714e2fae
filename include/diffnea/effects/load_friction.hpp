#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// load_friction: friction of a transmission in proportion to the torque τ that it transmits, μ|τ|
/// s. A drive that moves its load (τq̇ > 0, motoring) loses more than one that holds it back
/// (braking): of a gear with efficiency η the shares are 1/η − 1 and 1 − η (Hamon, Gautier, Garrec
/// and Janot 2010; as the directional models of servo friction, Duclusaud et al. 2025).
/// `braking_ratio` is the second over the first, η; at 1 the sides are alike.
struct LoadFriction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "load_friction",
        .formula = "mu |tau| tanh(qd/v0), times r where tau qd < 0",
        .summary = "friction in proportion to the transmitted torque, less when braking",
        .place = Place::kJoint,
        .parameters =
            {{.name = "mu", .unit = "1", .unit_prismatic = "1", .sign = Sign::kNonNegative},
             {.name = "braking_ratio",
              .unit = "1",
              .unit_prismatic = "1",
              .sign = Sign::kPositive,
              .linear = false,
              .initial = 1.0,
              .most = 1.0,
              .search = {0.4, 0.7, 1.0}},
             smoothing_parameter()},
        .motor_side = true,
        .traits = {Trait::kReadsAcceleration, Trait::kFollowsLoad, Trait::kOfDrive},
        .shown_over = {ShownOver::kLoad, ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T& load = x.tau[*joint];
    const T& qd = x.qd[*joint];
    const T size = select(value(load) < 0.0, T(-load), load);
    const T share = select(value(load) * value(qd) < 0.0, T(p[0] * p[1]), p[0]);
    tau[*joint] += share * size * smooth_sign(qd / p[2]);
  }
};

}  // namespace diffnea
