#pragma once
/// Springs and gaps in gears as candidates of simulated runs: the points at which they are tried.
/// Internal to diagnose/.

#include <vector>

#include <diffnea/identify/layout.hpp>

#include "identify/motion_data.hpp"

namespace diffnea {

/// A gear at each of its sizes, with the encoder at the link, then at the motor.
/// @param layout, x, shape  of the fit beside which it is tried: its drive sets sizes and flanks
std::vector<std::vector<EffectSpec>> gear_offers(const BoundEffect& gear, const FitLayout& layout,
                                                 const VecX<double>& x, const VecX<double>& shape,
                                                 const MotionData& data);

/// Tells whether an effect cannot act beside those of the model: a second hidden motor at a joint,
/// or one that reads accelerations there.
bool clashes(const Model& model, const BoundEffect& effect);

}  // namespace diffnea
