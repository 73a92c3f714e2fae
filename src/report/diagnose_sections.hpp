#pragma once
/// Sections of a diagnosis' page that say how well the models do.

#include <string>

#include <diffnea/diagnose/finding.hpp>

#include "report/time_charts.hpp"

namespace diffnea::report {

/// Names of the two models; one model where nothing was named.
ChartNames names_of(const Finding& finding);
/// For how long the simulation follows the robot: error over horizon, tolerances, motion over time.
std::string follows_section(const Finding& finding);
/// The torque or force that was learned without a name: tables, and curves or maps of it.
std::string grey_box_section(const Finding& finding);
/// Waterfall from the base model's error through each cause to the noise floor; errors of every
/// joint, and of a ball in mm.
std::string gain_section(const Finding& finding);

}  // namespace diffnea::report
