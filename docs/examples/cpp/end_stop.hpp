#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// end_stop: rubber at both ends of a joint's range, k (|q| − b) beyond ±b.
struct EndStop {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "end_stop",
                                  .formula = "k max(|q| - b, 0) sign(q)",
                                  .summary = "rubber at both ends of the range",
                                  .place = Place::kJoint,
                                  .parameters = {{.name = "stiffness",
                                                  .unit = "N*m/rad",
                                                  .unit_prismatic = "N/m",
                                                  .sign = Sign::kNonNegative},
                                                 {.name = "begin",
                                                  .unit = "rad",
                                                  .unit_prismatic = "m",
                                                  .sign = Sign::kPositive,
                                                  .linear = false,
                                                  .initial = 1.0,
                                                  .initial_prismatic = 0.1,
                                                  .search = log_grid(0.1, 3.0, 16),
                                                  .search_prismatic = log_grid(0.01, 1.0, 16)}}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const T& q = x.q[*joint];
    const T zero(0.0);
    const T above = select(q > p[1], T(q - p[1]), zero);
    const T below = select(q < -p[1], T(q + p[1]), zero);
    tau[*joint] += p[0] * (above + below);
  }
};

}  // namespace diffnea
