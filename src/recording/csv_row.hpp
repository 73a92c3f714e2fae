#pragma once
/// One line of a recording as numbers in SI, one for each column of its header. Internal.

#include <string_view>
#include <vector>

#include "recording/columns.hpp"
#include "recording/line_source.hpp"

namespace diffnea::detail {

/// @param line        the last of `lines`
/// @param row         (columns) overwritten; a gap is NaN
/// @param text_cells  (extra channels) cells that are no numbers are counted here and become NaN
/// @return false if the line is cut off at the end of the file
/// @throws DataError `file:line:column: …` for a cell that is no number, a row of another length
bool parse_row(std::string_view line, const LineSource& lines, const Columns& header,
               std::vector<double>& row, std::vector<long>& text_cells);

}  // namespace diffnea::detail
