#pragma once
/// The ball's part of a diagnosis. Internal to diagnose/.

#include <diffnea/diagnose/diagnose.hpp>

namespace diffnea {

/// Whether string and effects that the model has are fitted anew; else the model's are kept. A
/// string that was identified on calm motions is known to fractions of a millimetre: recordings in
/// which it lacks something would rather bend it than tell what.
bool fits_string(const Model& model, Base base);

/// Adds causes, candidates, witnesses, series and the verdict on the ball to `finding`, whose model
/// is extended.
/// @param train, test  recordings with a ball; `test` empty: every fourth window is held out
void diagnose_ball(const std::vector<Recording>& train, const std::vector<Recording>& test,
                   const DiagnoseOptions& options, Base base, Finding& finding);

}  // namespace diffnea
