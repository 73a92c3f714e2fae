#pragma once
/// Sensors that are slower than the log, which repeats their last value until there is a new one: a
/// row counts when its value was refreshed.

#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// Rows from one new value of each joint to the next, (n): 1 unless values stay the same for
/// several rows and then jump by far more than the grid that they lie on.
/// @param channel  q or tau
std::vector<int> refresh_rows(const std::vector<Recording>& recordings,
                              RowMatX<double> Recording::*channel = &Recording::q);

/// Step of the grid that all values of a channel lie on; 0 if there is none.
/// @param values   of the channel, any order  @param changes  from one row to the next, without 0
double quantisation_step(std::vector<double> values, const std::vector<double>& changes);

/// Steps of the grids that the positions of each joint lie on, (n) [rad] or [m]; 0 if there is
/// none.
std::vector<double> quantisation_steps(const std::vector<Recording>& recordings);

/// Rows of one channel at which its sensor has a new value, (N): all that are measured, unless the
/// sensor is slower than the log.
/// @param refresh  as of refresh_rows()
std::vector<bool> refreshed(const Eigen::Ref<const VecX<double>>& channel, int refresh);

/// Puts in the place of repeated values what lies on the line between the new ones; of the last
/// one's repeats, what that line goes on to.
/// @param channel  (N) of a uniform grid
void fill_stale(Eigen::Ref<VecX<double>> channel, int refresh);

}  // namespace diffnea
