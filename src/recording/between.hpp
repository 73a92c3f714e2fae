#pragma once
/// Values between those that are known: sensors that are slower than the log. Internal to the
/// library.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea::detail {

/// Known values on either side, of which one between them is made.
inline constexpr long kEachSide = 3;

/// Rows of those that are marked.
std::vector<long> rows_of(const std::vector<bool>& marked);

/// Value at a row, by Lagrange's polynomial through the known rows next to it: three on either
/// side, as many as there are at the ends.
/// @param at     (N) instants of the rows, or their numbers
/// @param y      (N) values, of which those at `known` count
/// @param known  rows, ascending, one at least
double between(const VecX<double>& at, const VecX<double>& y, const std::vector<long>& known,
               long row);

/// Puts in the place of a slow sensor's repeated values what such a polynomial has there; of the
/// last one's repeats, what the line through the last two goes on to.
/// @param channel  (N) of a uniform grid
/// @param refresh  rows from one new value to the next, as of refresh_rows()
void curve_stale(Eigen::Ref<VecX<double>> channel, int refresh);

}  // namespace diffnea::detail
