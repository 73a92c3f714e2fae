#pragma once
/// Random periodic motion within limits: a finite Fourier series per joint (Swevers et al. 1997).
/// It starts at rest, comes to rest once a period, and repeats exactly, so that noise can be told
/// from motion.

#include <cstdint>
#include <string>
#include <vector>

#include <diffnea/model/model.hpp>
#include <diffnea/recording/trajectory.hpp>

namespace diffnea {

/// Harmonics of a periodic motion.
struct FourierOptions {
  double duration = 20.0;  ///< [s], rounded up to whole periods
  double period = 10.0;    ///< [s]
  int harmonics = 5;       ///< at least 3: two go into starting at rest
  double rate = 500.0;     ///< of the rows [Hz]
  std::uint64_t seed = 0;  ///< of the random series, and of a search that goes on from them

  double position_share = 0.8;  ///< of the range between the limits that is used
  double velocity_share = 0.8;  ///< of the velocity limit
  double effort_share = 0.6;    ///< of the effort limit, by the model's own inverse dynamics
  // Where the model states no limit:
  double half_range = 1.0;      ///< revolute [rad]
  double velocity = 2.0;        ///< revolute [rad/s]
  double half_stroke = 0.1;     ///< prismatic [m]
  double slide_velocity = 0.3;  ///< prismatic [m/s]
  double ramp = 0.25;           ///< from rest to the velocity limit at the acceleration limit [s]
};

/// A trajectory of the joints that have a motor. Every joint moves about the middle of its range
/// with an amplitude that meets its position and velocity limits on the rows; then all amplitudes
/// shrink together until the torques that the model (without effects) needs meet the effort limits.
/// Loops close along it: joints that lead them have series, ranges are narrowed to where they
/// close. Of a robot that floats torques are those without weight, its base held.
/// @throws ModelError if no joint has a motor or may move, if limits are inverted, or if holding
/// the middle posture alone exceeds an effort limit;
///         Error for options out of range
Trajectory random_fourier(const Model& model, const FourierOptions& options);

/// What random_fourier() does where limits are missing or zero, one sentence each: a range of zero
/// width holds the joint there; a velocity or effort limit of 0 counts as not given.
std::vector<std::string> fourier_notes(const Model& model, const FourierOptions& options);

}  // namespace diffnea
