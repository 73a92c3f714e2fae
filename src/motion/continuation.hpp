#pragma once
/// Windows from one horizon to the next, and where they fall apart. Internal to the library.

#include <memory>
#include <string>

#include <diffnea/motion/horizon.hpp>

#include "motion/joint_windows.hpp"

namespace diffnea {

/// The simulators of as many workers, all alike.
using Workers = std::vector<std::unique_ptr<JointWindows>>;

/// Sets first states from the positions alone: a cubic through as much as the first horizon.
void set_measured_states(const std::vector<MotionStretch>& stretches, double first_horizon,
                         std::vector<MotionWindow>& windows);

/// Windows of another horizon that begin at states of these: simulated up to their first rows, or
/// measured where that simulation blows up.
std::vector<MotionWindow> continued(Workers& workers, const std::vector<MotionStretch>& stretches,
                                    const std::vector<MotionWindow>& windows, double horizon,
                                    double first_horizon);

/// Where a window falls apart: the error is a large part of the joint's motion about its mean.
struct Apart {
  std::size_t window = 0;  ///< index
  int joint = 0;           ///< the first that leaves
  double after = 0.0;      ///< time from the window's beginning [s]
};

/// Squared position errors of W windows and n joints [rad²] or [m²].
struct WindowErrors {
  RowMatX<double> sum;       ///< (W, n) over the window's rows; NaN where the simulation blew up
  RowMatX<double> count;     ///< (W, n) rows with a measured position
  std::vector<Apart> apart;  ///< windows that fall apart, in order

  /// Root mean square of each joint over all windows whose simulation stays finite, (n); NaN if
  /// there is none.
  VecX<double> rmse() const;
  /// How many windows' simulations blow up.
  long blown_up() const;
};

/// Simulates all windows from their states.
/// @param limit  (n) error beyond which a window is apart [rad] or [m]
WindowErrors window_errors(Workers& workers, const std::vector<MotionStretch>& stretches,
                           const std::vector<MotionWindow>& windows, const VecX<double>& limit);

/// Largest standard deviation over `limit` of the positions at a window's end that noise of the
/// torques makes, over joints, median over some windows. Above 1 the noise drowns the motion.
double torque_noise_share(JointWindows& simulator, const std::vector<MotionStretch>& stretches,
                          const std::vector<MotionWindow>& windows, const VecX<double>& density,
                          const VecX<double>& limit);

/// Windows that a model does not reproduce though it does the others: over ten times the joint's
/// median error. Something acted there that the model does not know, such as a hand.
/// @return one sentence that names joints and times; empty if there is none, or too few to tell
std::string unlike_the_others(const WindowErrors& errors,
                              const std::vector<MotionStretch>& stretches,
                              const std::vector<MotionWindow>& windows,
                              const std::vector<std::string>& joints);

}  // namespace diffnea
