#pragma once
/// Parts that the effects are made of.

#include <numbers>
#include <vector>

#include "effects.hpp"

namespace rigs {

constexpr double kTurn = 2.0 * std::numbers::pi;

inline const Joint& joint_of(const Scene& s, int j) {
  return s.arm.joints[static_cast<std::size_t>(j)];
}

/// 0 … n − 1: an effect that shows at every joint.
std::vector<int> every(int n);

/// Completes an effect of the sensors, of the bodies, outside the catalogue.
void sensor_effect(Effect& e, int joint, Scene& s);
void body_effect(Effect& e, Scene& s);
void outside_effect(Effect& e, int joint, Scene& s);

}  // namespace rigs
