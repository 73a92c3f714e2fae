#pragma once
/// Path of a ball in series.json, of fits and of diagnoses.

#include <optional>

#include <diffnea/identify/ball_series.hpp>

#include "io/json.hpp"

namespace diffnea::io {

/// Value of `ball` in series.json: columns to 6 digits, at most 4000 rows. null if there is no
/// ball.
/// @throws ModelError if a column has another length than time
Json ball_columns(const std::optional<BallSeries>& ball);

/// Reads `ball` of series.json into what result.json said.
/// @throws ModelError if the columns differ in length, or result.json has no ball
void read_ball_columns(JsonObject& root, std::optional<BallSeries>& ball);

}  // namespace diffnea::io
