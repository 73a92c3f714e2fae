#pragma once
/// The ball's part of a diagnosis. Internal to diagnose/.

#include <diffnea/diagnose/diagnose.hpp>

namespace diffnea {

/// Adds causes, candidates, witnesses, series and the verdict on the ball to `finding`, whose model
/// is extended.
/// @param train, test  recordings with a ball; `test` empty: every fourth window is held out
void diagnose_ball(const std::vector<Recording>& train, const std::vector<Recording>& test,
                   const DiagnoseOptions& options, Base base, Finding& finding);

}  // namespace diffnea
