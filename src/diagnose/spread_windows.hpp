#pragma once
/// Windows of growing length, a bounded number of them, over stretches of any lengths. Internal to
/// diagnose/.

#include <diffnea/motion/window.hpp>

namespace diffnea {

/// Spreads windows evenly over the stretches, at their first rows among others, each as
/// long as the shortest horizon.
/// @param most  number of windows, where stretches are no more
std::vector<MotionWindow> spread_windows(const std::vector<MotionStretch>& stretches,
                                         double horizon, std::size_t most);
/// Lengthens the windows that can be as long; none begins before another has ended.
/// @param most  rows of all of them times the square of the joints; one window may have more
std::vector<MotionWindow> lengthened(const std::vector<MotionStretch>& stretches,
                                     const std::vector<MotionWindow>& windows, double horizon,
                                     double most);

}  // namespace diffnea
