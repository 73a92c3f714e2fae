#pragma once
/// For how long the base and the extended model follow held-out motion. Internal to diagnose/.

#include <array>
#include <functional>

#include <diffnea/diagnose/simulated_motion.hpp>

#include "diagnose/held_out_motion.hpp"

namespace diffnea {

/// Longest horizon within the tolerance, on straight lines between points in scales of equal
/// ratios: the first crossing. 0: the first point is beyond; the last horizon: none is.
/// @param horizons  ascending [s]
/// @param errors    over the tolerance; NaN ends them
double follows(const std::vector<double>& horizons, const std::vector<double>& errors);

struct HeldOutSimulation {
  SimulatedMotion motion;
  /// At no horizon is the extended model better, at one it is worse for certain, and it follows for
  /// less than half as long.
  bool loses = false;
  /// Why no simulation holds what the extended model has more than the base; empty: one does.
  std::string unheld;
};

/// Simulates windows of growing length from estimated first states, until both models fall apart.
/// Takes a bounded number of windows.
/// @param motion  of either model, with the torques that drive it; rows and sensors are the same
/// @param runs   numbers of the recordings, as the models' effects know them
/// @param alike  the models are the same
/// @param go_on  asked before every window; false ends it with what there is
/// @return without `joints` where there is a reason
HeldOutSimulation simulate_held_out(const Model& base, const Model& extended, bool alike,
                                    const std::array<HeldOutMotion, 2>& motion,
                                    const std::vector<int>& runs,
                                    const std::function<bool()>& go_on);

}  // namespace diffnea
