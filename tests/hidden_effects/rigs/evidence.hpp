#pragma once
/// How much a recording can tell of what is hidden in it.

#include "case.hpp"

namespace rigs {

/// Simpler effects in the place of the hidden one.
struct Rival {
  std::vector<std::string> effects;
  double lm_beyond = 0.0;  ///< LM that they leave of it
};

/// Keys of truth.json; the README explains them.
struct Evidence {
  double size = 0.0, raw_lm = 0.0, expected_lm = 0.0, reachable_lm = 0.0, visible_share = 0.0;
  std::vector<Rival> rivals;
};

std::vector<Evidence> evidence(const Case& c, const Recording& recording);

/// Deviation of the torque noise per row and joint: sensors, motors, commands between the rows.
Eigen::VectorXd torque_noise(const Case& c, const Recording& recording);

}  // namespace rigs
