#pragma once
/// A model that simulates windows from first states: what estimating these states needs of it.
/// Internal to the library.

#include <limits>

#include <diffnea/core/triangular_factor.hpp>
#include <diffnea/motion/window.hpp>

namespace diffnea {

/// Not thread-safe.
class WindowSimulator {
 public:
  virtual ~WindowSimulator() = default;

  /// Numbers of a first state.
  virtual int states() const = 0;
  /// Adds the rows (q̂ − q)/σ of a window: [J_state | J of free parameters, if any | residual].
  /// @return whether the simulation reached the window's end
  virtual bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                         const VecX<double>& sigma, TriangularFactor& rows) = 0;
  /// ½ Σ (residual/σ)²; +∞ if it blew up.
  virtual double cost(const MotionStretch& stretch, const MotionWindow& window,
                      const VecX<double>& sigma) = 0;
  /// Makes the next rows of the last window exact. @return whether they were not
  virtual bool sharpen() { return false; }
  /// Positions, (rows, n); NaN from a blow-up on.
  virtual RowMatX<double> positions(const MotionStretch& stretch, const MotionWindow& window) = 0;
};

/// When an estimate of a first state ends.
struct StateFitOptions {
  int max_iterations = 50;  ///< Gauss–Newton steps
  double tolerance = 1e-5;  ///< stop when a step gains a smaller share of the cost
  double enough = 0.0;      ///< cost that leaves nothing to gain
  /// Cost that no better state is worth exact rows for, where they promise no less.
  double hopeless = std::numeric_limits<double>::infinity();
  /// Cost above which the window does not matter: one that no step promises to bring below it gets
  /// no second step.
  double most = std::numeric_limits<double>::infinity();
};

/// Estimates the first state of one window, from the one that it has.
/// @param simulator  without free parameters
void fit_state(WindowSimulator& simulator, const MotionStretch& stretch, MotionWindow& window,
               const VecX<double>& sigma, const StateFitOptions& options);

}  // namespace diffnea
