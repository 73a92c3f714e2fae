#pragma once
/// Noise of sensors from their own signals: what no model has to explain. It is estimated once and
/// stays, so that a fit cannot pass what its model lacks off as noise.
///
/// Divided differences of order d over d + 1 rows of a channel remove every polynomial of degree
/// d − 1 and leave the noise, at any spacing of the rows. Motion that they leave falls with d, so
/// that the least of the orders 2 to 6 counts; medians make it blind to spikes.

#include <vector>

#include <diffnea/recording/recording.hpp>
#include <diffnea/recording/refresh.hpp>

namespace diffnea {

/// Noise of the channels of n joints.
struct SensorNoise {
  VecX<double> position;  ///< (n) standard deviation of a position [rad] or [m]; at least the floor
  VecX<double> step;      ///< (n) quantisation of the position [rad] or [m]; 0: none seen
  /// (n) rows from one new position to the next of a sensor that is slower than the log; 1: none.
  std::vector<int> refresh;
  VecX<double> torque;  ///< (n) standard deviation of a row's torque [N·m] or [N]; 0: known exactly
  VecX<double> density;  ///< (n) spectral density Q of the torque's noise [N²m²s] or [N²s]
  VecX<double> period;   ///< (n) median time between two rows with a position [s]
};

/// Smallest noise of a position [rad] or [m]: rounding of a simulation's logs, below any encoder.
inline constexpr double kPositionFloor = 1e-9;

/// Noise of all channels; a quantisation step counts as a floor of step²/12 of the variance.
/// @param recordings  of the same joints
/// @param passive     (n) joints whose torque is known to be 0
/// @throws DataError if a joint has no position at all
SensorNoise sensor_noise(const std::vector<Recording>& recordings,
                         const std::vector<bool>& passive);

}  // namespace diffnea
