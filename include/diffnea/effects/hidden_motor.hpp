#pragma once
/// Where torques act at a joint whose motor is hidden behind a spring or a gap.

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// Share of an effect's torque that acts on the motor's side: 1 of what drives have (ripple,
/// offsets, gains), 0 of what pulls at the link itself (springs, forces, drag), `friction_share` of
/// all else that drives and gears have.
double motor_share(const EffectInfo& effect, double friction_share);

}  // namespace diffnea
