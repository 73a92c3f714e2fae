#pragma once
/// Errors that no motion repeats: an oscillation in the time alone, or bursts. Noise of a drive has
/// a continuous spectrum, and the same strength wherever the motion is alike. Internal to
/// diagnose/.

#include <vector>

#include "diagnose/evidence.hpp"

namespace diffnea {

/// Rest that a model leaves of a recording's rows.
struct Rest {
  const Evidence& evidence;
  VecX<double> left;       ///< (rows()) [N·m] or [N]
  std::vector<bool> used;  ///< (rows()) rows that count if they do not rest; empty: all
};

/// Rest of one joint that is no noise.
struct Unsteady {
  long joint = -1;            ///< index into the evidence's joints
  double frequency_hz = 0.0;  ///< oscillation's [Hz]; 0: bursts
  double share = 0.0;         ///< part of the mean square left of the joint's fitted rows
};

/// At most one of each driven joint, seen in the fitted and in the held-out rows: an oscillation
/// whose line stands out of the spectrum, and further than it does of the torque's if that has most
/// of it, or, where there is none, bursts: blocks whose error is many times that of blocks with
/// about the same position, velocity and torque, away from standstills.
std::vector<Unsteady> find_unsteady(const Rest& fitted, const Rest& held_out);

}  // namespace diffnea
