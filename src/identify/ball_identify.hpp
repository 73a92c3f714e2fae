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
  std::vector<std::string> asked;  ///< entries of the choice that are about a ball alone
};
DividedChoice divide_choice(const Model& model, const FitChoice& choice);

/// Gives entries of `fix` such as "*drag*" to whom they match: arm, ball, or both.
/// @throws ModelError naming all parameters if one matches neither, or if another part of the
///         choice has no such name
void share_fix(const Model& model, DividedChoice& choice);

/// @throws ModelError as make_ball_layout, or if an entry of `fix` matches no parameter
BallLayout ball_layout_for(const Model& model, const DividedChoice& choice);

/// All rows of a source, the blocks of each run joined; of those with a ball alone.
std::vector<Recording> recordings_with_ball(const RecordingSource& source);

/// Whether a torque was measured in any of the recordings.
bool has_torque(const RecordingSource& source);

/// What there is of a ball in model or recordings, but not in both; empty if nothing.
std::string ball_note(const Model& model, const RecordingSource& train);
/// @throws ModelError if the recordings hold nothing but a ball, and the model has none
void refuse_ball_alone(const Model& model, const RecordingSource& train);

/// Whether a spin was recorded in any of the windows.
bool has_spin(const BallData& data);
/// @throws DataError if none was, which magnus needs
void require_spin(const BallData& data);

/// Adds parameters, errors, series and notes to `result`, whose model the ball is fitted with (and
/// in which it is put).
void identify_ball(const std::vector<Recording>& train, const std::vector<Recording>& test,
                   const DividedChoice& choice, const IdentifyOptions& options,
                   IdentifyResult& result);

}  // namespace diffnea
