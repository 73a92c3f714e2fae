#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// maxwell_element: a spring and a damper in series across a joint, as rubber hoses and bundles of
/// cables are. What winds it up, z, relaxes within T: at constant velocity the torque ends at k T
/// q̇.
struct MaxwellElement {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "maxwell_element",
        .formula = "k z, dz/dt = qd - z/T",
        .summary = "spring that relaxes: rubber, hoses, bundles of cables",
        .place = Place::kJoint,
        .port = Port::kMemory,
        .parameters = {{.name = "stiffness",
                        .unit = "N*m/rad",
                        .unit_prismatic = "N/m",
                        .sign = Sign::kNonNegative},
                       {.name = "relaxation_time",
                        .unit = "s",
                        .unit_prismatic = "s",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 0.3,
                        .search = log_grid(0.03, 3.0, 7)}}};
    return kInfo;
  }

  template <Scalar T>
  static StateRate<T> derivative(const T& z, const T&, const T* p) {
    return {.per_velocity = T(1.0), .drift = -z / p[1], .forgetting = T(1.0) / p[1]};
  }

  template <Scalar T>
  static T torque(const T& z, const T&, const T* p) {
    return p[0] * z;
  }

  template <Scalar T>
  static AtRest<T> at_rest(const T* p) {
    return {.stiffness = p[0], .damping = T(0.0)};
  }
};

}  // namespace diffnea
