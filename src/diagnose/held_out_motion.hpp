#pragma once
/// Held-out rows as motion that can be simulated: stretches with the torques that drive them, noise
/// of the sensors, and within which error a simulation follows. Internal to diagnose/.

#include <map>

#include <diffnea/identify/source.hpp>

#include "diagnose/evidence.hpp"
#include "motion/window_simulator.hpp"

namespace diffnea {

/// Held-out motion of n joints.
struct HeldOutMotion {
  /// Runs are numbered as the evidence's; of fast logs, some of the rows.
  std::vector<MotionStretch> stretches;
  std::map<int, std::vector<int>> resting;  ///< driven joints that stand still all along a run
  std::map<int, double> begins;             ///< time of the first row of each run [s]
  SensorNoise noise;             ///< sensors' noise, of all rows that were logged
  VecX<double> size;             ///< (n) motion_size()
  VecX<double> tolerance;        ///< (n) error within which a simulation follows [rad] or [m]
  std::string reason;            ///< why nothing can be simulated; empty: something can
};

/// Stretches of the same joints as motion; runs begin with their first rows.
HeldOutMotion motion_of_stretches(std::vector<MotionStretch> stretches, const SensorNoise& noise);

/// Recordings of the same joints, or parts of them, as motion.
HeldOutMotion motion_of(const std::vector<Recording>& parts);

/// @param evidence  of the held-out recordings, which `source` holds
/// @param held      (evidence.rows()) rows that are held out; empty: whole recordings
/// @param late      by how much torques act later than their rows say [s]
HeldOutMotion held_out_motion(const RecordingSource& source, const Evidence& evidence,
                              const std::vector<bool>& held, double late);

}  // namespace diffnea
