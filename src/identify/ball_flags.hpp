#pragma once
/// What a fit shows of the data: rows far off any path, spins that the path contradicts. Internal
/// to identify/ and diagnose/.

#include <limits>

#include "identify/ball_path.hpp"

namespace diffnea {

/// Leaves out, and flags, rows whose error is beyond 10 of what is usual with this fit, and windows
/// most of which is; unless more than a tenth of all rows is, which is no matter of outliers.
/// @param ball  fitted to `data`
/// @param most_on_end  longer stretches of far rows stay, where they may be the model's fault
/// @return whether something was left out
bool drop_far_rows(const FittedBall& ball, BallData& data, const FlightOptions& flight,
                   std::size_t most_on_end = std::numeric_limits<std::size_t>::max());

/// A lift C_M ω × v has one C_M for all windows. Where most windows agree on one (binomial test),
/// the windows whose own C_M is beyond four times it, under a quarter, or of the other sign, are
/// left out and flagged: their spin is not that of the flight.
/// @param ball   fitted to `data`, without lift or with it  @param sigma  of a position [m]
/// @param agreed  C_M that the windows agree on, of other data; 0: found here. In and out.
/// @return whether something was left out
bool drop_false_spins(const FittedBall& ball, BallData& data, double sigma,
                      const BallFitOptions& options, double& agreed);

}  // namespace diffnea
