#pragma once
/// Output error: simulate windows of the recording with the measured torque and compare positions
/// (multiple shooting; Bock 1983). Needs no velocity, acceleration or filter, hence no bias from
/// them: where torques are small differences of large terms, this is what to use.
///
/// Each window has its own initial state, estimated with the parameters and eliminated by a QR of
/// the window's rows, so that a Gauss–Newton step costs one small convex problem
/// (solve_convex_fit), in which physical consistency holds exactly. Sensitivities are integrated
/// with the state (Runge–Kutta 4): ∂q̈/∂π = −M⁻¹Y, ∂q̈/∂(q, q̇) analytic, effects by Jets.

#include <functional>

#include <diffnea/identify/convex_fit.hpp>
#include <diffnea/identify/layout.hpp>
#include <diffnea/identify/shooting_window.hpp>

namespace diffnea {

/// Windows, steps and tolerances of the trajectory loss.
struct TrajectoryOptions {
  double window = 0.5;  ///< length of a window [s]
  /// Horizons before the full one, as shares: long windows are not convex until the fit is close.
  std::vector<double> stages{0.25, 0.5};
  int max_iterations = 50;   ///< Gauss–Newton steps of the last stage; half of it in the others
  double tolerance = 1e-5;   ///< stop when a step gains a smaller share of the objective
  SteppingOptions stepping;  ///< of the simulation
  int threads = 1;           ///< that share the windows; results do not depend on it
};

/// Estimates of the trajectory loss, and how the fit ended.
struct TrajectoryFit {
  VecX<double> x;      ///< (p) linear parameters of the layout
  VecX<double> sigma;  ///< (n) output error of each joint [rad] or [m]
  MatX<double> R;      ///< (f, p) factor of the last linearisation, in units of sigma
  MatX<double>
      covariance;          ///< (p, p) of x: windows as clusters (Liang, Zeger 1986), prior included
  long samples = 0;        ///< positions compared
  double objective = 0.0;  ///< χ²/2 with sigma, of the windows whose simulation does not blow up
  int iterations = 0;      ///< Gauss–Newton steps of all stages
  bool converged = false;  ///< the last stage did, and no window blows up
  bool interrupted = false;  ///< the callback said so; x is the best until then
  std::string termination;   ///< why it ended, in words
};

/// @param start    (p) where to start; what the data cannot tell stays there
/// @param scale    (p) how far a parameter may well be from start
/// @param windows  their states are updated
/// @param progress called after every step with (stage, iteration, objective); false stops
/// @throws ModelError if an effect has no forward form
TrajectoryFit fit_trajectories(const Model& model, const FitLayout& layout,
                               const VecX<double>& start, const VecX<double>& scale,
                               std::vector<ShootingWindow>& windows,
                               const TrajectoryOptions& options,
                               const std::function<bool(const char*, int, double)>& progress = {});

}  // namespace diffnea
