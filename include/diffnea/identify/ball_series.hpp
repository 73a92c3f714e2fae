#pragma once
/// The ball's path as the camera saw it and as two models have it: what pictures are made of. Plain
/// data, row by row of the rows at which the ball was seen.

#include <array>
#include <string>
#include <vector>

namespace diffnea {

/// Rows or flights that cannot be true, and why. They are left out, but for rows beyond the
/// string's reach, which are named alone.
struct BallFlag {
  int run = 0;          ///< number of the recording
  double time = 0.0;    ///< [s]
  std::string channel;  ///< "ball", "spin"
  std::string reason;   ///< a sentence with numbers
};

/// A ball as it was seen, and as models before and after the fit move it, row by row.
struct BallSeries {
  using Point = std::array<double, 3>;  ///< [m], W; NaN: none

  bool held_out = false;        ///< of the test recordings; otherwise of the fitted ones
  bool has_string = false;      ///< false: it flies freely; no anchor, length 0
  std::vector<int> run;         ///< number of the recording
  std::vector<int> window;      ///< each starts from an estimated state of its own
  std::vector<double> time;     ///< [s]
  std::vector<Point> measured;  ///< as the camera saw it
  std::vector<Point> base;      ///< of the model before the fit, or without the causes
  std::vector<Point> extended;  ///< of the model as fitted, or with them
  std::vector<Point> anchor;    ///< where the string is tied (of the extended model)
  std::vector<bool> taut;       ///< of the extended model
  double length = 0.0;          ///< of its string [m]
  /// Noise of one position along one axis [m]: the camera's, as its rows tell it whatever the
  /// model; where they are too few, what the fit leaves.
  double sigma = 0.0;
  double base_rms = 0.0;          ///< error of `base`, of one position along one axis [m]
  double extended_rms = 0.0;      ///< error of `extended`, likewise
  std::vector<BallFlag> flagged;  ///< rows and flights that cannot be true

  /// Number of rows.
  long rows() const { return static_cast<long>(time.size()); }
};

}  // namespace diffnea
