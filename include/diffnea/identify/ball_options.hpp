#pragma once
/// How a ball is fitted.

#include <array>

#include <diffnea/dynamics/ball_flight.hpp>

namespace diffnea {

/// What is compared: paths, or accelerations with the constraint as a penalty.
enum class BallLoss {
  kTrajectory,   ///< output error over simulated windows: what to use on noisy cameras
  kConstrained,  ///< error of the acceleration, with g, ġ and g̈ as penalties (paper, section IV)
};

/// How ball and string are fitted.
struct BallFitOptions {
  BallLoss loss = BallLoss::kTrajectory;  ///< of the ball, whatever the loss of the arm
  double window = 2.0;                    ///< [s], at most
  double shortest = 0.1;                  ///< a shorter stretch is left out [s]
  double longest_gap = 0.1;               ///< rows further apart are of two windows [s]
  FlightOptions flight{.step = 0.01};     ///< a swing at 1 Hz is off by 1e-6 of its size then
  int max_iterations = 60;                ///< steps of a descent, refused ones too
  double tolerance = 1e-8;                ///< stop when a step would gain a smaller share of χ²
  double sigma = 0.0;  ///< of a position along one axis [m]; 0: estimated with the fit
  bool robust = true;  ///< Huber's loss at 3 σ (per position), for outliers of the camera
  /// Constrained loss: weights λ_g, λ_ġ, λ_g̈ of the penalties, each over its own noise.
  std::array<double, 3> lambda{1.0, 1.0, 1.0};
};

}  // namespace diffnea
