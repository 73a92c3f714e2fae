#pragma once
/// First states of windows, eliminated: every window has its own, and a step of the fit costs what
/// the common parameters cost. Of any simulated system. Internal to the library.

#include <diffnea/core/triangular_factor.hpp>

namespace diffnea {

/// Rest of a window's rows [J_state | J_parameters | residual] once its first state is eliminated.
struct ReducedWindow {
  bool finite = false;   ///< all rows are there, and they determine the first state
  RowMatX<double> rows;  ///< (f, f+1) [J | r] that no first state can explain
  MatX<double> R_state;  ///< (s, s) triangular
  MatX<double> top;      ///< (s, f+1): R_state δz = −r − J δx

  /// The first state's best step beside a step of the parameters, (s).
  VecX<double> state_step(const VecX<double>& dx) const;
};

/// @param rows    of one window, factored
/// @param states  number s of the first columns
/// @param finite  whether the simulation reached the window's end
ReducedWindow eliminate(const TriangularFactor& rows, int states, bool finite);

}  // namespace diffnea
