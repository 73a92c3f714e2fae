#pragma once
/// For how long a simulation follows the robot, in words.

#include <string>

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

/// "Your simulation follows the robot for 1.5 s within 5 mrad; with these causes, for 40 s.", or
/// why that is not known; empty of a ball alone.
std::string follows_sentence(const Finding& finding);
/// The finding's sentence without that one.
std::string verdict_sentence(const Finding& finding);
/// Where simulations fall apart, in one sentence; empty if nowhere.
std::string apart_sentence(const Finding& finding);
/// "1.5 s"
std::string in_seconds(double t);
/// "1.5 s", "at least 40 s" where nothing longer was simulated.
std::string followed(const SimulatedMotion& motion, double t);
/// Tells whether the tolerance is that of the sensor's noise, not of the motion.
bool is_of_noise(const SimulatedSeries& joint);

}  // namespace diffnea::report
