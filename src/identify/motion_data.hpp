#pragma once
/// Recordings as motion that can be simulated: what fits by windows work on. Internal to identify/.

#include <string>
#include <vector>

#include <diffnea/identify/source.hpp>
#include <diffnea/motion/window.hpp>

namespace diffnea {

/// Error over a joint's motion, both root mean squares, beyond which a simulation is apart.
inline constexpr double kApart = 0.5;

/// Stretches of n joints.
struct MotionData {
  std::vector<MotionStretch> train, test;
  SensorNoise noise;      ///< sensors' of `train`
  std::vector<int> runs;  ///< numbers of all recordings, those of the fit first
  long rows = 0;          ///< of the recordings of the fit
};

/// @param test       held-out recordings; null: there are none
/// @param commanded  (n) joints that drives of the model lead
/// @param notes      recordings of which nothing can be simulated
/// @throws DataError if nothing of the fitted, or of the held-out recordings can be simulated
MotionData motion_data(const Model& model, const RecordingSource& train,
                       const RecordingSource* test, const std::vector<bool>& commanded,
                       std::vector<std::string>& notes);

/// Joints that no stretch moves.
std::vector<int> still_joints(const std::vector<MotionStretch>& stretches,
                              const SensorNoise& noise);

/// Error beyond which a window is apart, (n) [rad] or [m]: over half of a joint's motion about its
/// mean, which explains less than three quarters of its variance, and beyond its noise.
VecX<double> apart_limit(const MotionData& data);

}  // namespace diffnea
