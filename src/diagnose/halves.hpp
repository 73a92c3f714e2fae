#pragma once
/// A path known twice, by samples whose noise is independent: what one shows is an instrument for
/// what the other leaves (Durbin 1954). Internal to diagnose/.

#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// Tells whether every other sample of the positions is enough for the plan's path.
bool halves_suffice(const PreprocessPlan& plan);

/// Positions of which every other new one is known, the others between them by polynomials: those
/// that are even, or odd, by their number.
/// @param logged  (N, n) positions; of slow sensors on lines between new ones
RowMatX<double> half_of(const RowMatX<double>& logged, const PreprocessPlan& plan, bool even);

}  // namespace diffnea
