#pragma once
/// How much of a hidden effect the ball's path can show: what it changes of the positions, what of
/// that other initial states and another string cannot take up, and what of that another effect
/// cannot. By simulation and finite differences.

#include "ball_effects.hpp"

namespace hidden {

/// A simulated recording: the path, and the rows that the camera saw.
struct BallRun {
  std::vector<Hand> hand;       ///< every half step
  std::vector<BallState> path;  ///< every step
  std::vector<double> pull;     ///< of the string at every step [N]
  long first = 0, every = 40;   ///< steps of the camera's rows
  long rows = 0;
};

struct BallRival {
  std::string effect;
  double lm_beyond = 0.0;  ///< expected LM of the truth over it
};
struct BallEvidence {
  double raw_lm = 0.0;       ///< Σ ‖Δ‖²/σ², Δ of windows of 2 s that start in the true states
  double expected_lm = 0.0;  ///< after projecting out the windows' first states and the string
  double visible_share = 0.0;
  std::vector<BallRival> rivals;
};

/// @param effect  name of what is hidden in `world`
/// @param refit  length and attachment are the base; otherwise nothing is
/// @param sigma  of the camera along one axis [m]
BallEvidence ball_evidence(const BallWorld& world, const std::string& effect, bool refit,
                           double sigma, const BallRun& run);

}  // namespace hidden
