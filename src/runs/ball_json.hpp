#pragma once
/// What results of fits and diagnoses share about a ball: a summary in result.json, its path in
/// series.json.

#include <optional>

#include <diffnea/identify/ball_series.hpp>

#include "io/json.hpp"

namespace diffnea::io {

/// Value of `ball` in result.json: noise, errors, the string's length, what was left out. null if
/// there is no ball.
Json ball_summary(const std::optional<BallSeries>& ball);

/// Value of `ball` in series.json: columns to 6 digits, at most 4000 rows. null if there is no
/// ball.
/// @throws ModelError if a column has another length than time
Json ball_columns(const std::optional<BallSeries>& ball);

/// Reads `ball` of result.json; nothing where it is null or missing.
std::optional<BallSeries> read_ball_summary(JsonObject& root);

/// Reads `ball` of series.json into what read_ball_summary left.
/// @throws ModelError if the columns differ in length, or result.json has no ball
void read_ball_columns(JsonObject& root, std::optional<BallSeries>& ball);

}  // namespace diffnea::io
