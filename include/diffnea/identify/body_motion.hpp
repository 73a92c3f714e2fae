#pragma once
/// Measured motion of bodies in maximal coordinates: poses as a sensor saw them, and the poses,
/// twists and accelerations that local quintics make of them.

#include <array>
#include <vector>

#include <diffnea/dynamics/free_body.hpp>

namespace diffnea {

/// Poses of all bodies at one instant, as they were measured.
struct PosedRow {
  double time = 0.0;               ///< [s]
  int stretch = 0;                 ///< rows of one stretch follow each other without a gap
  std::vector<Pose<double>> X_WB;  ///< one per body
};

/// Standard deviations along one axis, in the body's frame, of a value and of its first and second
/// derivative in time.
struct BodyNoise {
  std::array<double, 3> angle{},  ///< [rad, rad/s, rad/s²]; zero of a particle
      position{};                 ///< [m, m/s, m/s²]
  double row_angle = 0.0;         ///< noise of a measured row's turn, for weights [rad]
  double row_position = 0.0;      ///< noise of a measured row's place, for weights [m]
};

/// States and accelerations of all bodies at one instant.
struct BodySample {
  double time = 0.0;                         ///< [s]
  int stretch = 0;                           ///< samples of one follow each other
  std::vector<BodyState<double>> states;     ///< one per body
  std::vector<Twist<double>> accelerations;  ///< V̇ per body, in B [rad/s², m/s²]
  long first_row = 0;                        ///< measured row that `weights` begin with
  /// Weights of the measured rows in value and derivatives [1, 1/s, 1/s²]. Empty: the noises of
  /// these are independent, and of other samples'.
  std::vector<std::array<double, 3>> weights;
};

/// Motion that the constrained loss is fitted to.
struct BodyMotion {
  std::vector<BodySample> samples;  ///< in order of time within each stretch
  std::vector<BodyNoise> noise;     ///< one per body; zero: known exactly
  int half_width = 0;               ///< rows on either side that a sample was smoothed from
};

/// Smoothed motion: at rows with enough neighbours the quintics of least squares through
/// positions and through log(R_kᵀ R). Their width is the largest at which a sextic in the motion,
/// told from the sensor's noise, biases accelerations less than noise does: a fast motion is not
/// flattened, and a slow one gains from all rows that it has.
/// @param rows  in order of time within each stretch, equally many bodies each
/// @throws DataError if no stretch has nine rows, or times do not increase
BodyMotion smooth_bodies(const std::vector<PosedRow>& rows);

}  // namespace diffnea
