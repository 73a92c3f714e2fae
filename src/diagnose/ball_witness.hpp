#pragma once
/// On what does the rest of a ball's path depend? Internal to diagnose/.

#include <string>

#include <diffnea/diagnose/remainder.hpp>

#include "identify/ball_path.hpp"

namespace diffnea {

/// Quadratic functions of three variables, and periods in time, against what is left of every
/// axis; those that pass
/// ΔBIC > 10, best first. Errors are of windows that were given initial states of their own.
std::vector<Witness> ball_witnesses(const FittedBall& ball, const BallFitOptions& options);

/// Where a few windows hold what is left, and the others fit: when, and what may have happened, for
/// no law of motion does that; empty otherwise.
std::string held_by_few_windows(const BallSeries& series);

}  // namespace diffnea
