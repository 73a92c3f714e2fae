#pragma once
/// A ball on a page: its path in space, the string's length, the error over the string's directions
/// and over time.

#include <string>
#include <vector>

#include <diffnea/identify/ball_series.hpp>

#include "report/time_charts.hpp"

namespace diffnea::report {

/// The section of a page.
std::string ball_section(const BallSeries& ball, const ChartNames& names);

/// "the ball is simulated 8.1 mm from where the camera saw it before and 1.2 mm after (rms along
/// one axis; the camera's noise is 1.1 mm)"; without the capital letter and the full stop of a
/// sentence.
std::string ball_sentence(const BallSeries& ball, bool one_model);

/// Rows and flights that were looked at and not fitted: the first of them, then how many more.
std::vector<std::string> flagged_lines(const BallSeries& ball, std::size_t most = 5);

}  // namespace diffnea::report
