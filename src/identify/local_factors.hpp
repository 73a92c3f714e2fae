#pragma once
/// Torques of one instant in each of many short windows, from a polynomial through the positions:
/// no filter, hence of runs of any length. Good for scales and for what the links' inertia absorbs,
/// not for a fit. Internal to identify/.

#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/motion/window.hpp>

namespace diffnea {

/// Local motion in the middle of each window.
std::vector<LocalMotion> middle_motions(const std::vector<MotionStretch>& stretches,
                                        const std::vector<MotionWindow>& windows);

/// Factors of [Y τ], one a joint, of one row a window.
/// @param motions  of these windows (middle_motions)
std::vector<JointFactor> local_factors(const Model& model, const FitLayout& layout,
                                       const std::vector<MotionStretch>& stretches,
                                       const std::vector<MotionWindow>& windows,
                                       const std::vector<LocalMotion>& motions);

/// Holds what the links' inertia absorbs at the model's value.
/// @param notes  one for each
/// @return local_factors()
std::vector<JointFactor> hold_absorbed(const Model& model,
                                       const std::vector<MotionStretch>& stretches,
                                       const std::vector<MotionWindow>& windows, FitLayout& layout,
                                       std::vector<std::string>& notes);

}  // namespace diffnea
