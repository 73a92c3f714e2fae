#pragma once
/// A ball on a string that swings in a cone below a moving hand, as results hold it: made up, so
/// that every number of its pictures is known.

#include <cmath>
#include <limits>

#include <diffnea/core/random.hpp>
#include <diffnea/identify/ball_series.hpp>

namespace diffnea::test {

struct SwungBallOptions {
  int windows = 6, rows = 400;  ///< of each window
  double dt = 0.005;            ///< [s]
  double length = 0.41;         ///< of the string, and of the extended model [m]
  double base_excess = -0.01;   ///< the base model's string is shorter [m]
  double sigma = 1e-3;          ///< of the camera [m]
  double angle = 0.6;           ///< of the cone [rad]
};

/// Half of each window taut, then a flight half the string's length away from the hand.
inline BallSeries swung_ball(const SwungBallOptions& o = {}) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  Rng rng(5);
  BallSeries b;
  b.has_string = b.held_out = true;
  b.length = o.length;
  b.sigma = o.sigma;
  double base = 0.0, extended = 0.0;
  for (int w = 0; w < o.windows; ++w)
    for (int k = 0; k < o.rows; ++k) {
      const double t = (w * (o.rows + 40) + k) * o.dt, phase = 5.0 * t;
      const bool taut = k % 200 < 150;
      const BallSeries::Point hand{0.1 * std::sin(0.7 * t), 0.05 * std::cos(0.9 * t), 1.0};
      const double tilt = o.angle * (0.6 + 0.4 * std::sin(0.4 * t));
      const double r = taut ? o.length : 0.7 * o.length;
      const BallSeries::Point u{std::sin(tilt) * std::cos(phase), std::sin(tilt) * std::sin(phase),
                                -std::cos(tilt)};
      const auto at = [&](double radius) {
        return BallSeries::Point{hand[0] + radius * u[0], hand[1] + radius * u[1],
                                 hand[2] + radius * u[2]};
      };
      b.run.push_back(w < o.windows / 2 ? 0 : 1);
      b.window.push_back(w);
      b.time.push_back(w < o.windows / 2 ? t : t - (o.windows / 2) * (o.rows + 40) * o.dt);
      b.anchor.push_back(hand);
      b.taut.push_back(taut);
      b.extended.push_back(at(r));
      b.base.push_back(at(r + o.base_excess));
      b.measured.push_back(at(r));
      for (double& x : b.measured.back()) x += o.sigma * rng.normal();
      for (std::size_t c = 0; c < 3; ++c) {
        base += std::pow(b.measured.back()[c] - b.base.back()[c], 2);
        extended += std::pow(b.measured.back()[c] - b.extended.back()[c], 2);
      }
    }
  const double n = 3.0 * static_cast<double>(b.rows());
  b.base_rms = std::sqrt(base / n);
  b.extended_rms = std::sqrt(extended / n);
  b.measured[7] = b.base[20] = {kNaN, kNaN, kNaN};
  for (int k = 0; k < 7; ++k)
    b.flagged.push_back({0, 0.5 + 0.3 * k, "ball", "0.3 m from where <the model> has it"});
  return b;
}

}  // namespace diffnea::test
