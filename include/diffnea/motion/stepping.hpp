#pragma once
/// How simulated motion is stepped.

namespace diffnea {

/// Steps of the integration, within the time between two rows.
struct SteppingOptions {
  /// Step times the steepest rate of friction, which an explicit step stands up to 2.7; beyond it
  /// steps are shorter, or implicit.
  double max_step = 2.0;
  /// Step times the fastest frequency of the motion at its beginning [rad]: the phase is off by
  /// its fourth power over 120 a radian.
  double max_phase = 0.1;
};

}  // namespace diffnea
