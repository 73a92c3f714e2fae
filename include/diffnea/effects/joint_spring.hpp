#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// joint_spring: a spring at the joint, k (q − q₀).
struct JointSpring {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "joint_spring",
                                  .formula = "k (q - q0)",
                                  .summary = "spring or cable that pulls towards a rest position",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "stiffness",
                                                  .unit = "N*m/rad",
                                                  .unit_prismatic = "N/m",
                                                  .native = NativeField::kStiffness},
                                                 {.name = "rest",
                                                  .unit = "rad",
                                                  .unit_prismatic = "m",
                                                  .linear = false,
                                                  .initial = 0.0,
                                                  .native = NativeField::kSpringReference}},
                                  .motor_side = false,
                                  .shown_over = {ShownOver::kPosition, ShownOver::kSpectrum}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    tau[*joint] += p[0] * (x.q[*joint] - p[1]);
  }
};

}  // namespace diffnea
