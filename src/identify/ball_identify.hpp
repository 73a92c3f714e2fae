#pragma once
/// The ball's part of identify(). Internal to identify/.

#include <diffnea/identify/ball_fit.hpp>
#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// What of a choice is the arm's, and what the ball's.
struct DividedChoice {
  FitChoice arm;
  std::vector<EffectSpec> ball_effects;  ///< those of the model first
  std::vector<std::string> ball_fix;
  bool fit_string = false, fit_effects = false;
};
DividedChoice divide_choice(const Model& model, const FitChoice& choice);

/// @throws ModelError as make_ball_layout, or if an entry of `fix` matches no parameter
BallLayout ball_layout_for(const Model& model, const DividedChoice& choice);

/// All rows of a source, the blocks of each run joined; of those with a ball alone.
std::vector<Recording> recordings_with_ball(const RecordingSource& source);

/// Adds parameters, errors, series and notes to `result`, whose model the ball is fitted with (and
/// in which it is put).
void identify_ball(const std::vector<Recording>& train, const std::vector<Recording>& test,
                   const DividedChoice& choice, const IdentifyOptions& options,
                   IdentifyResult& result);

}  // namespace diffnea
