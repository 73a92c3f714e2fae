#pragma once
/// Losses that outliers do not bend, of a residual u in units of its noise: Huber's and Cauchy's
/// (Holland, Welsch 1977). Internal to identify/.

#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// What a loss makes of a residual u: its score is ψ(u) = weight·u.
struct Influence {
  double weight = 1.0;  ///< of the row
  double slope = 1.0;   ///< ψ'(u)
};

/// Weight and slope at u; 1 and 1 for least squares.
Influence influence_of(Robust kind, double u);

/// What the loss counts u as: ρ(u), u²/2 for least squares.
double robust_cost(Robust kind, double u);

}  // namespace diffnea
