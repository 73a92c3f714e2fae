#pragma once
/// Torques of one instant in each of many short windows, from a polynomial through the positions:
/// no filter, hence of runs of any length. Good for scales and for what the links' inertia absorbs,
/// not for a fit. Internal to identify/.

#include <functional>

#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/motion/window.hpp>

namespace diffnea {

/// Local motion in the middle of each window.
std::vector<LocalMotion> middle_motions(const std::vector<MotionStretch>& stretches,
                                        const std::vector<MotionWindow>& windows);

/// Tells whether a window counts for a joint.
using CountsFor = std::function<bool(const MotionWindow&, int joint)>;

/// Factors of [Y τ], one a joint, of one row a window.
/// @param motions  of these windows (middle_motions)
/// @param counts   which windows are left in; empty: all
std::vector<JointFactor> local_factors(const Model& model, const FitLayout& layout,
                                       const std::vector<MotionStretch>& stretches,
                                       const std::vector<MotionWindow>& windows,
                                       const std::vector<LocalMotion>& motions,
                                       const CountsFor& counts = {});

/// Linear parameters that fit the torques of one instant, (p); empty where these are too few.
VecX<double> inverse_guess(const FitLayout& layout, const std::vector<JointFactor>& factors);

/// Holds what the links' inertia absorbs at the model's value.
/// @param notes  one for each
/// @return local_factors()
std::vector<JointFactor> hold_absorbed(const Model& model,
                                       const std::vector<MotionStretch>& stretches,
                                       const std::vector<MotionWindow>& windows, FitLayout& layout,
                                       std::vector<std::string>& notes);

}  // namespace diffnea
