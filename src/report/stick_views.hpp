#pragma once
/// A movement as drawings of lines: frames side by side, and one that plays where scripts run.

#include <string>
#include <vector>

#include <diffnea/runs/policy_result.hpp>

#include "report/svg.hpp"

namespace diffnea::report {

/// What happens at a row of a figure.
struct TellingTime {
  long row = 0;
  std::string what;  ///< may be empty
};
/// About `count` rows, in order: start, the far end of the swing, the string slack, the ball over
/// the rim or nearest to the cup, the end; and some between.
std::vector<TellingTime> telling_times(const StickFigure& figure, double string, int count);

/// What a drawing takes up [m]: all that is ever drawn of the figures.
struct Stage {
  Range across, up;
};
Stage stage(const std::vector<const StickFigure*>& figures);

/// @param ghost  the ball as it was imagined, drawn lightly; nullptr: none
std::string film_strip(const StickFigure& figure, const StickFigure* ghost, double string);
std::string player(const StickFigure& figure, const StickFigure* ghost, double string);

}  // namespace diffnea::report
