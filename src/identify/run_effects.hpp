#pragma once
/// Effects that act in some recordings only: bodies that sidecars say the robot held, and what was
/// asked for with `:run=K`. Internal to identify/.

#include <diffnea/identify/layout.hpp>
#include <diffnea/identify/source.hpp>

namespace diffnea {

/// Whether the fit has anything that depends on the recordings' numbers.
bool depends_on_runs(const Model& model, const FitChoice& choice, const RecordingSource& train,
                     const RecordingSource* test);

/// Adds a payload for every body that recordings hold: equal ones share their parameters. What is
/// known of it is held, in `choice`.
/// @param runs  those of the fit, then the held-out ones
Model with_held_bodies(const Model& model, const std::vector<RunDescription>& runs,
                       FitChoice& choice);

/// Refuses effects that were asked for in recordings that do not exist, or that leave nothing to
/// fit them from; holds those of the model that find no recording of the fit.
/// @param training  number of recordings of the fit; the first of `runs`
/// @throws ModelError listing the recordings
void check_runs(const std::vector<RunDescription>& runs, int training, const Model& model,
                FitLayout& layout, std::vector<std::string>& notes);

}  // namespace diffnea
