#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// quadratic_friction: drag in proportion to speed squared, c q̇|q̇|.
struct QuadraticFriction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "quadratic_friction",
                                  .formula = "c qd |qd|",
                                  .summary = "drag in proportion to speed squared",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "quadratic",
                                                  .unit = "N*m*s^2/rad^2",
                                                  .unit_prismatic = "N*s^2/m^2",
                                                  .sign = Sign::kNonNegative}},
                                  .motor_side = false,
                                  .reads = Reads::kSpeed,
                                  .shown_over = {ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T& qd = x.qd[*joint];
    tau[*joint] += p[0] * qd * select(qd < T(0.0), -qd, qd);
  }
};

}  // namespace diffnea
