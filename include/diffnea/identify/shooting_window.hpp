#pragma once
/// Stretches of a recording that are simulated from their own initial state with the measured
/// torque.

#include <string>
#include <vector>

#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// A stretch of a recording that is simulated in one go.
struct ShootingWindow {
  int run = 0;                  ///< number of its recording
  std::vector<double> time;     ///< (m) [s]
  RowMatX<double> q;            ///< (m, n) measured, NaN where not
  RowMatX<double> u;            ///< (m, n) torque that acts from row k to k+1
  RowMatX<double> u_end;        ///< (m, n) torque at the end of that step (u if held)
  VecX<double> state;           ///< (2n) q, q̇ at the first row: estimate
  VecX<double> measured_state;  ///< (2n) the same from the filtered recording
};

/// How windows are stepped: Runge–Kutta 4 at the recording's rate, in shorter steps where friction
/// is steep.
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

/// Squared position errors of W windows and n joints [rad²] or [m²].
struct WindowErrors {
  RowMatX<double> sum;    ///< (W, n) over the window's rows; NaN where the simulation blew up
  RowMatX<double> count;  ///< (W, n) rows with a measured position

  /// Root mean square of each joint over all windows whose simulation stays finite, (n); NaN if
  /// there is none.
  VecX<double> rmse() const;
  /// How many windows' simulations blow up.
  long blown_up() const;
};

/// Simulates all windows; initial states as they are in `state`, or as measured.
WindowErrors window_errors(const Model& model, const std::vector<ShootingWindow>& windows,
                           bool measured_state, const SteppingOptions& options);

/// Windows that a model does not reproduce though it does the others: over ten times the joint's
/// median error. Something acted there that the model does not know, such as a hand.
/// @return one sentence that names joints and times; empty if there is none, or too few to tell
std::string unlike_the_others(const WindowErrors& errors,
                              const std::vector<ShootingWindow>& windows,
                              const std::vector<std::string>& joints);

}  // namespace diffnea
