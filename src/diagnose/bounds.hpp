#pragma once
/// What a recording says of candidates' shapes before any is tested. Internal to diagnose/.

#include <diffnea/diagnose/tried.hpp>

#include "diagnose/candidates.hpp"
#include "diagnose/evidence.hpp"

namespace diffnea {

/// Bounds the grids of candidates to what the recording can show, and drops those that it cannot.
/// @param plan    knows the noise of each joint's positions and torque, as read
/// @param halves  whether effects see other noise than rows hold, in held-out data too
/// @return those that were dropped for want of it, or for too much noise
std::vector<Refusal> bound_shapes(const Evidence& evidence, const FitLayout& layout,
                                  const PreprocessPlan& plan, bool halves,
                                  std::vector<Candidate>& candidates);

}  // namespace diffnea
