#pragma once
/// Whether a ball is in the cup, from what a camera would have seen. Heights h are along the cup's
/// axis from its origin, distances ρ from that axis.
///
/// A reward tells little of it: a ball that is parked between forearm and cup, or on the rim, is
/// close to the cup and falls off later. Look at the end of a series that goes on for a second
/// after the movement.

#include <string>

#include <diffnea/core/scalar.hpp>
#include <diffnea/model/ball.hpp>

namespace diffnea {

/// When a ball counts as caught.
struct SuccessOptions {
  double window = 0.5;  ///< at the end, throughout which the ball is in the cup [s]
  double slack = 2e-3;  ///< by which its centre may be beyond the inner radius [m]
};

/// How a trial ended.
enum class Outcome {
  kInCup,    ///< floor < h < rim and ρ < inner radius + slack throughout the window
  kLate,     ///< it is in the cup at the end, and was not throughout the window
  kFellOut,  ///< it was in the cup, and is not
  kRim,      ///< it lies on the rim
  kBeside,   ///< it leans on the cup from outside, or lies below its floor
  kMissed,   ///< it never was in the cup, nor is near
};

/// How a trial ended, and when.
struct BallVerdict {
  Outcome outcome = Outcome::kMissed;  ///< at the end of the series
  std::string text;                    ///< one clause: when, and by how much
};

/// @param time             (T) [s], increasing
/// @param ball, cup, axis  (T, 3) the ball's centre, the cup's origin [m] and axis (unit vector),
/// in one frame; a row that is not finite counts as outside
/// @throws ShapeError if rows or columns differ; DataError if the series is shorter than the window
BallVerdict judge_ball(const VecX<double>& time, const RowMatX<double>& ball,
                       const RowMatX<double>& cup, const RowMatX<double>& axis, const CupSpec& spec,
                       const SuccessOptions& options = {});

/// Whether the verdict is kInCup.
bool ball_in_cup(const VecX<double>& time, const RowMatX<double>& ball, const RowMatX<double>& cup,
                 const RowMatX<double>& axis, const CupSpec& spec,
                 const SuccessOptions& options = {});

}  // namespace diffnea
