#pragma once
/// Where torques act at a joint whose motor is hidden behind a spring or a gap.

#include <vector>

#include <diffnea/effects/bound_effect.hpp>

namespace diffnea {

/// Share of an effect's torque that acts on the motor's side: 1 of what drives have (ripple,
/// offsets, gains), 0 of what pulls at the link itself (springs, forces, drag), `friction_share` of
/// all else that drives and gears have.
double motor_share(const EffectInfo& effect, double friction_share);

/// One number a joint: of its friction, what turns with its hidden motor; −1: none is hidden.
using MotorShares = std::vector<double>;

/// One for each joint where one of its joints hides its motor; friction that couples joints stays
/// whole.
std::vector<BoundEffect> parts_at_motors(const BoundEffect& effect, const MotorShares& shares);

/// Of an effect's torque, what turns with the hidden motors at its joints; the least of them.
double share_at_motors(const BoundEffect& effect, const MotorShares& shares);

/// That share of an effect's torque, which is homogeneous in the linear parameters.
BoundEffect scaled(BoundEffect effect, double share);

}  // namespace diffnea
