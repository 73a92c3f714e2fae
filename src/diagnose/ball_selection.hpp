#pragma once
/// The choice of what a ball's path lacks, and of rows that cannot be true. Internal to diagnose/.

#include "diagnose/ball_case.hpp"

namespace diffnea {

/// Solves the case: rows that cannot be true are left out, `base`, `best` and `first_scores` are
/// set, and the finding is told what was refused.
void select_causes(BallCase& c);

}  // namespace diffnea
