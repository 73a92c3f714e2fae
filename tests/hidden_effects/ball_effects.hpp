#pragma once
/// What can hide in the recording of a ball, by the names of the catalogue.

#include <string>
#include <vector>

#include "ball_swing.hpp"

namespace hidden {

/// One scalar of an effect, and where it is in the world.
struct BallParameter {
  std::string name;
  double& (*at)(BallWorld&);
};

struct BallEffect {
  std::string name, where;
  double unit = 0.0;   ///< the size ×1: of each parameter, or of the vector's length
  bool signs = false;  ///< may be negative
  std::vector<BallParameter> parameters;
};

/// @param nominal  whose string some of the units depend on
std::vector<BallEffect> ball_effects(const BallWorld& nominal);

}  // namespace hidden
