#pragma once
/// What the ball pulls at the arm. Internal to identify/ and diagnose/.

#include <string>

#include <diffnea/identify/ball_options.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// The same recordings with the torques of the arm alone, τ + Jᵀ(T u): the tension T along u, from
/// the anchor to the ball, is that of the fitted path. Where the ball was not seen it hangs.
/// @return null where there is nothing to take out: no ball or string, one that is tied to the
///         world, or no recording that shows it; those that do not show it stay as they are
std::unique_ptr<RecordingSource> without_ball_pull(const Model& model,
                                                   const RecordingSource& source,
                                                   const BallFitOptions& options,
                                                   const PreprocessOptions& smoothing);

/// What to say where it was taken out: of which recordings it was not.
std::string ball_pull_note(const RecordingSource& source);

}  // namespace diffnea
