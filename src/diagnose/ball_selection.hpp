#pragma once
/// The choice of what a ball's path lacks: causes are added one by one, in pairs or all at once,
/// dropped and exchanged. Internal to diagnose/.

#include "diagnose/ball_case.hpp"

namespace diffnea {

/// Of a candidate's path that the base leaves: below, the base takes it over.
inline constexpr double kAbsorbedPath = 0.01;

/// Solves the case: rows that cannot be true are left out, `base`, `best` and `first_scores` are
/// set, and the finding is told what was refused.
void select_causes(BallCase& c);

}  // namespace diffnea
