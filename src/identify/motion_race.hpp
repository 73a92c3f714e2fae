#pragma once
/// Where fits of drives begin, and what they leave out. A bound that the recording reaches (of
/// speed, of torque, a dead band) is found only from where it acts, and one that it does not reach
/// is a corner at which every step of the fit stumbles: several beginnings compete, those without
/// bounds among them. Internal to identify/.

#include "identify/motion_climb.hpp"

namespace diffnea {

/// The beginning that goes on. Without drives that have a loop of their own there is one; else fits
/// compete over pieces of the recordings, and one that cannot catch up drops out. The best leaves
/// out bounds that the recordings do not need: at the edge of what was seen they would hold back
/// motion that was not.
/// @param layout    parameters that the fit may move
/// @param ladder    horizons, ascending
/// @param progress  as for MotionFitter
MotionBeginning best_beginning(const Model& model, const MotionData& data, const FitLayout& layout,
                               const std::vector<double>& ladder, const MotionOptions& options,
                               const std::function<bool(int, double)>& progress);

}  // namespace diffnea
