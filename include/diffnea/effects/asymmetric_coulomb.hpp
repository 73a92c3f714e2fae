#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// asymmetric_coulomb: dry friction of another size in each direction, F₊ max(s, 0) + F₋ min(s, 0).
struct AsymmetricCoulomb {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "asymmetric_coulomb",
                                  .formula = "F+ max(s, 0) + F- min(s, 0), s = tanh(qd/v0)",
                                  .summary = "dry friction that differs between the two directions",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "coulomb_positive",
                                                  .unit = "N*m",
                                                  .unit_prismatic = "N",
                                                  .sign = Sign::kNonNegative},
                                                 {.name = "coulomb_negative",
                                                  .unit = "N*m",
                                                  .unit_prismatic = "N",
                                                  .sign = Sign::kNonNegative},
                                                 smoothing_parameter()},
                                  .motor_side = true,
                                  .reads = Reads::kSpeed,
                                  .shown_over = {ShownOver::kVelocity}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T& qd = x.qd[*joint];
    tau[*joint] += select(qd < T(0.0), p[1], p[0]) * smooth_sign(qd / p[2]);
  }
};

}  // namespace diffnea
