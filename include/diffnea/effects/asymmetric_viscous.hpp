#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// asymmetric_viscous: viscous friction of another size in each direction, b₊ max(q̇, 0) + b₋ min(q̇,
/// 0).
struct AsymmetricViscous {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "asymmetric_viscous",
        .formula = "b+ max(qd, 0) + b- min(qd, 0)",
        .summary = "viscous friction that differs between the two directions",
        .place = Place::kJoint,
        .parameters = {{.name = "viscous_positive",
                        .unit = "N*m*s/rad",
                        .unit_prismatic = "N*s/m",
                        .sign = Sign::kNonNegative},
                       {.name = "viscous_negative",
                        .unit = "N*m*s/rad",
                        .unit_prismatic = "N*s/m",
                        .sign = Sign::kNonNegative}},
        .motor_side = true,
        .reads = Reads::kSpeed,
        .shown_over = {ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T& qd = x.qd[*joint];
    tau[*joint] += select(qd < T(0.0), p[1], p[0]) * qd;
  }
};

}  // namespace diffnea
