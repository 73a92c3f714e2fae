#pragma once
/// Stretches of a recording that are simulated from their own initial state with the measured torque.

#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/recording/recording.hpp>
#include <vector>

namespace diffnea {

/// A stretch of a recording that is simulated in one go.
struct ShootingWindow {
  int run = 0;
  std::vector<double> time;  ///< (m) [s]
  RowMatX<double> q;         ///< (m, n) measured, NaN where not
  RowMatX<double> u;         ///< (m, n) torque that acts from row k to k+1
  RowMatX<double> u_end;     ///< (m, n) torque at the end of that step (u if held)
  VecX<double> state;        ///< (2n) q, q̇ at the first row: estimate
  VecX<double> measured_state;  ///< (2n) the same from the filtered recording
};

/// How windows are stepped: Runge–Kutta 4 at the recording's rate, in shorter steps where friction is steep.
struct SteppingOptions {
  double max_step = 2.0;  ///< h·λ of the fastest friction allowed in one step (stable to 2.7)
};

/// Windows of a recording, initial states from q filtered at `filter_hz`.
/// @throws DataError if no window of that length has a torque at every row
std::vector<ShootingWindow> make_windows(const Recording& recording, double window_seconds,
                                         double filter_hz, const std::vector<bool>& passive);

/// Positions of one window, (m, n), from its state; rows after a blow-up are NaN.
RowMatX<double> simulate_window(ForwardDynamics& dynamics, const ShootingWindow& window,
                                const VecX<double>& state, const SteppingOptions& options);

/// Root mean square position error of each joint over windows, (n), initial states as they are in
/// `state` or as measured.
VecX<double> window_rmse(const Model& model, const std::vector<ShootingWindow>& windows,
                         bool measured_state, const SteppingOptions& options);

}  // namespace diffnea
