#pragma once
/// What slopes before and after its bounces tell of a table. Internal to identify/.

#include <optional>

#include <diffnea/identify/ball_fit.hpp>

namespace diffnea {

/// Parameters of the effect `bounce`.
struct BounceGuess {
  double restitution = 0.0, friction = 0.0;  ///< [1]
  double height = 0.0;                       ///< of the table [m]
};

/// Medians over the bounces seen with five rows on either side: where the paths before and after
/// meet, and what the velocity there becomes. A ball that grips tells a friction that is smaller
/// than the table's, and so is where a fit has to start: once it grips, more friction changes
/// nothing, and the derivative is 0.
/// @return empty where there are fewer than three such bounces
std::optional<BounceGuess> guess_bounce(const BallData& data, const BallSpec& ball,
                                        const Vec3<double>& gravity, double longest_gap);

}  // namespace diffnea
