#pragma once
/// Times that are in another unit than they seem. Internal.

#include <string>
#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea::detail {

/// Asks whether a time is in milliseconds: rows are too far apart for a robot, and as milliseconds
/// they would last a second and more. Empty: nothing to ask.
/// @param dt  usual interval [s]
std::string time_unit_question(const VecX<double>& time, double dt);
/// The same of the first of the recordings that it is asked of.
std::string time_unit_question(const std::vector<Recording>& recordings);

/// Says that rows are too far apart to see a robot's dynamics, and that their time may be in
/// another unit, where it may. Empty: they are not.
std::string slow_rows(const std::vector<Recording>& recordings);

/// Rows a thousand, a million times as far apart as those that were fitted are in another unit.
/// @param fitted    interval of the fitted recordings [s]
/// @param held_out  interval of these [s]
/// @throws DataError that says which of them
void require_unit_of_time(const std::vector<Recording>& recordings, double fitted, double held_out);

}  // namespace diffnea::detail
