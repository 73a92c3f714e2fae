#pragma once
/// A fitted ball, its path, and the series that pictures are made of. Internal to identify/ and
/// diagnose/.

#include <diffnea/identify/ball_fit.hpp>

namespace diffnea {

/// A model of the ball with values, and the states that its windows start from with them.
struct FittedBall {
  Model model;
  BallLayout layout;
  VecX<double> p;
  BallData data;
};

/// The same parameters on other data: only the windows' states are estimated.
FittedBall fit_states(const FittedBall& ball, const BallData& data, const BallFitOptions& options);

/// The model with the layout's values in place.
Model apply_ball(const Model& model, const BallLayout& layout, const VecX<double>& p);

/// guess_string of a string that was not identified; one that was, or that the data do not tell
/// (fast motions, slack half of the time), stays.
void guess_unknown_string(StringSpec& string, const BallData& data, const Vec3<double>& gravity);

/// Noise of the camera over all windows (identify/ball_rows.hpp); NaN where there are too few rows.
double camera_noise(const BallData& data, double longest_gap);

/// Measured positions about their mean, root mean square along one axis [m].
double path_spread(const BallData& data);

/// Root mean square of one position along one axis [m].
double path_rms(const FittedBall& ball, const FlightOptions& flight);

/// Of windows that both were fitted to.
BallSeries make_ball_series(const FittedBall& base, const FittedBall& extended,
                            const FlightOptions& flight);

}  // namespace diffnea
