#pragma once
/// How much of a hidden effect a recording can show: its torque, what of it the base parameters
/// cannot take up, and what of that a simpler effect cannot.

#include <string>
#include <vector>

#include "case.hpp"

namespace hidden {

/// An effect, or a few at once, that could be named instead.
struct Rival {
  std::vector<std::string> effects;
  double lm_beyond = 0.0;  ///< expected LM of the truth over the rival
};

/// Per hidden effect, from the noise-free torques at 50 Hz, e = effect_torque, whitened by the
/// noise:
struct Evidence {
  double size = 0.0;         ///< rms(e)/rms(torque), largest of its joints
  double raw_lm = 0.0;       ///< Σ e²/σ²
  double expected_lm = 0.0;  ///< the same after projecting out the base and the other effects
  /// With the positions' noise in σ as well, of the rows as they are: Σ |e(ω)|²/S(ω),
  /// S = σ² + Σ (M_jk ω²)² σ_q², times visible_share². No test of torque against motion has more.
  double reachable_lm = 0.0;
  double visible_share = 0.0;  ///< of e's norm, what that projection leaves
  std::vector<Rival> rivals;   ///< at the same joint
};

/// σ² is the torque noise's variance at 50 Hz; coloured noise counts with its level at low
/// frequency. The base: ten inertial parameters a link and what the model declares.
std::vector<Evidence> evidence(const Case& c, const Series& series);

}  // namespace hidden
