#pragma once
/// A ball's drawings that are not over time: its path in space, and its error over the sphere of
/// the string's directions.

#include <string>
#include <utility>
#include <vector>

#include <diffnea/runs/result.hpp>

namespace diffnea::report {

/// First row and one past the last of each window.
std::vector<std::pair<std::size_t, std::size_t>> windows_of(const BallSeries& ball);

/// Rows whose path is drawn: some windows, spread over the series.
struct ShownPath {
  std::vector<std::vector<std::size_t>> rows;  ///< per window, thinned
  std::size_t windows = 0;                     ///< that there are
};
ShownPath shown_path(const BallSeries& ball);

/// Ball and anchor from the front, the side and above, one scale for all three.
std::string projections(const BallSeries& ball, const ShownPath& shown, bool with_base);

/// The same for a canvas that turns: JSON, an object of a list per line; lengths in m.
std::string space_json(const BallSeries& ball, const ShownPath& shown, bool with_base);

/// Mean error along (colour) and across (arrows) the string over its direction, in an equal-area
/// map with straight down in the middle (Lambert 1772), of the base model and of the extended one.
/// Empty without a string, or if no direction is known.
std::string sphere(const BallSeries& ball, const std::string& before, const std::string& after,
                   bool with_base);

}  // namespace diffnea::report
