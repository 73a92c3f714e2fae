#pragma once
/// Horizons by continuation: windows of length T are fitted, then those of 2T that begin at the
/// states of the shorter ones, until a window is a whole run. A long window's cost has many minima,
/// a short one's has one: its error is nearly linear in the parameters. What tells models apart is
/// in the long ones, where errors add up.

#include <diffnea/motion/stepping.hpp>
#include <diffnea/motion/window.hpp>

namespace diffnea {

/// Horizons, steps and tolerances of fits to simulated windows.
struct MotionOptions {
  /// Longest horizon [s]; 0: whole runs, or until windows fall apart.
  double horizon = 0.0;
  /// Shortest horizon [s], 0: a tenth of a second, or as many positions as tell a state well.
  double first_horizon = 0.0;
  int max_iterations = 50;   ///< Gauss–Newton steps at a horizon
  double tolerance = 1e-5;   ///< stop when a step gains a smaller share of the objective
  SteppingOptions stepping;  ///< of the simulation
  int threads = 1;           ///< that share the windows; results do not depend on it
};

/// The ladder of horizons [s], ascending by factors of two up to the longest.
std::vector<double> horizons(const std::vector<MotionStretch>& stretches, const SensorNoise& noise,
                             const MotionOptions& options);

}  // namespace diffnea
