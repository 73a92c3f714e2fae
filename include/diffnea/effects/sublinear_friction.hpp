#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// sublinear_friction: friction that grows slower than speed, F s √|q̇|, as lubricated gears show
/// it.
struct SublinearFriction {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "sublinear_friction",
                                  .formula = "F tanh(qd/v0) sqrt(|qd|)",
                                  .summary = "friction that grows with the root of speed",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "sublinear",
                                                  .unit = "N*m*(s/rad)^0.5",
                                                  .unit_prismatic = "N*(s/m)^0.5",
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
    using std::sqrt;
    // √ has no derivative at 0, s √|q̇| has: 0. A floor under the root, too small to show, gives
    // that.
    const T floor(1e-100);
    const T speed = select(qd < T(0.0), -qd, qd);
    tau[*joint] += p[0] * smooth_sign(qd / p[1]) * sqrt(select(speed < floor, floor, speed));
  }
};

}  // namespace diffnea
