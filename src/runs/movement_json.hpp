#pragma once
/// Movements in the series of `learn` and `transfer`: at most 100 rows a second, to 6 digits.

#include <diffnea/experiment/stick_figure.hpp>

#include "io/json.hpp"

namespace diffnea::io {

/// Rows a second that series.json holds, where there is room for them [Hz].
constexpr double kMovementRate = 100.0;

/// Rows at about that rate, the first and the last. @param rate  [Hz]; 0: none
RolloutTrace thinned(const RolloutTrace& trace, double rate = kMovementRate);

/// The series of a run whose movements are so many that our own reader would not take it at the
/// full rate: at the highest that it takes, or without rows.
/// @param at  rate [Hz] → the file's text
template <class At>
std::string readable_series(const At& at) {
  constexpr double kLowestRate = 6.0;  // a movement is not recognised below
  double rate = kMovementRate;
  for (; rate > kLowestRate; rate /= 2.0)
    if (std::string out = at(rate); has_room(out)) return out;
  return at(0.0);
}

/// time, channels (q_<joint>, ball, cup, axis, phase), figure (null without one), reward, solved,
/// failure.
Json movement(const RolloutTrace& trace, const StickFigure* figure);

/// @param figure  overwritten if given, empty where the file has none
/// @throws ModelError if columns differ in length
RolloutTrace read_movement(JsonObject& o, StickFigure* figure);

}  // namespace diffnea::io
