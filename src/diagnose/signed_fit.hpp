#pragma once
/// Least squares in few parameters, some of which must not be negative. Internal to diagnose/.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Solves K x = b. Where columns depend on others, a ridge on the products of columns of length 1
/// shares what they explain. @param K  positive semidefinite
VecX<double> ridge_solve(MatX<double> K, const VecX<double>& b, double ridge);

struct SignedFit {
  VecX<double> x;
  double gain = 0.0;  ///< ‖r‖² − ‖r − G x‖²
};

/// From K = GᵀG and b = Gᵀr, by active sets (Lawson and Hanson 1974, ch. 23).
/// @param start  keeps the signs; near the solution, a step or two are left of one a parameter.
/// Nothing: 0
SignedFit signed_fit(const MatX<double>& K, const VecX<double>& b,
                     const std::vector<bool>& nonnegative, const VecX<double>& start = {});

}  // namespace diffnea
