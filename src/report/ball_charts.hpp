#pragma once
/// Pictures of a ball: its path in space, the string's length, the error over the string's
/// directions and over time.

#include <string>
#include <vector>

#include <diffnea/runs/result.hpp>

#include "report/time_charts.hpp"

namespace diffnea::report {

/// The section of a page, its charts' data included: they are the page's set "ball".
std::string ball_section(const BallSeries& ball, const ChartNames& names);

/// "the ball's position misses the camera's by 8.1 mm before and by 1.2 mm after, of which 1.1 mm
/// are noise (rms along one axis)"; without the capital letter and the full stop of a sentence.
std::string ball_sentence(const BallSeries& ball, bool one_model);

/// Rows and flights that were looked at and not fitted: the first of them, then how many more.
std::vector<std::string> flagged_lines(const BallSeries& ball, std::size_t most = 5);

}  // namespace diffnea::report
