#pragma once
/// Where fits of drives begin, and what they leave out. A bound that the recording reaches (of
/// speed, of torque, a dead band) is found only from where it acts, and one that it does not reach
/// is a corner at which every step of the fit stumbles: several beginnings compete over the short
/// horizons, the one without bounds among them. Internal to identify/.

#include "identify/motion_climb.hpp"

namespace diffnea {

/// Beginnings of a fit to these data: one, where no drive has a loop of its own.
/// @param layout  what the fit may move
/// @param first   shortest horizon [s]
std::vector<MotionBeginning> beginnings(const Model& model, const MotionData& data,
                                        const FitLayout& layout, double first);

/// The beginning that goes on, at where it came to: fits climb together, and one that another beats
/// beyond doubt at a horizon drops out.
/// @param ladder    horizons, ascending
/// @param progress  as for MotionFitter
MotionBeginning best_beginning(const Model& model, const MotionData& data,
                               std::vector<MotionBeginning> from, const std::vector<double>& ladder,
                               const MotionOptions& options,
                               const std::function<bool(int, double)>& progress);

/// Leaves out bounds of drives that the recordings do not need, and fits the rest anew: at the edge
/// of what was seen they would hold back motion that was not.
/// @return their names; empty: all are needed
std::vector<std::string> release_bounds(const Model& model, const MotionData& data,
                                        const MotionOptions& options, MotionClimb& climb);

}  // namespace diffnea
