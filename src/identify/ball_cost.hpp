#pragma once
/// What a window of a ball's path costs, for the fit alone. Internal to identify/.

#include <vector>

#include <diffnea/identify/ball_fit.hpp>

namespace diffnea {

/// Numbers of a first state: position and velocity.
inline constexpr int kBallState = 6;

/// Indices of the layout's parameters that are not fixed.
std::vector<int> free_parameters(const BallLayout& layout);

/// Seen less predicted positions of one window, (3m) [m].
VecX<double> ball_window_errors(const Model& model, const BallLayout& layout, const VecX<double>& p,
                                const BallData& data, const BallWindow& window,
                                const FlightOptions& flight);

/// ball_cost() of one window; infinite where its simulation blows up.
double ball_window_cost(const Model& model, const BallLayout& layout, const VecX<double>& p,
                        const BallData& data, const BallWindow& window, double sigma,
                        const BallFitOptions& options);

}  // namespace diffnea
