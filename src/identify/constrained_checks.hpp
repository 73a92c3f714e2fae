#pragma once
/// Motions and constraints that the constrained loss refuses before it begins. Internal to
/// identify/.

#include <diffnea/identify/constrained_loss.hpp>

namespace diffnea {

/// @throws DataError if there is nothing to fit, or a body's noise is zero that its equations need
/// @throws ShapeError if samples have other bodies than the motion's noise
void require_bodies(const ConstrainedModel& model,
                    const std::vector<ConstrainedParameter>& parameters, const BodyMotion& motion);

/// @throws DataError if a constraint that no parameter moves does not hold: its name, by how much,
/// and the constraints that leave it no room
void require_agreement(const ConstrainedModel& model,
                       const std::vector<ConstrainedParameter>& parameters,
                       const BodyMotion& motion);

}  // namespace diffnea
