#pragma once
/// Movements in the series of `learn` and `transfer`: at most 100 rows a second, to 6 digits.

#include <diffnea/experiment/stick_figure.hpp>

#include "io/json.hpp"

namespace diffnea::io {

/// Rows that series.json holds: about 100 a second, the first and the last.
RolloutTrace thinned(const RolloutTrace& trace);

/// time, channels (q_<joint>, ball, cup, axis, phase), figure (null without one), reward, solved,
/// failure.
Json movement(const RolloutTrace& trace, const StickFigure* figure);

/// @param figure  overwritten if given, empty where the file has none
/// @throws ModelError if columns differ in length
RolloutTrace read_movement(JsonObject& o, StickFigure* figure);

}  // namespace diffnea::io
