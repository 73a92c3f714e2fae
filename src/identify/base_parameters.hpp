#pragma once
/// What the data tell apart. Internal.

#include <vector>

#include <diffnea/identify/linear_fit.hpp>

namespace diffnea {

/// Base parameters by QR with column pivoting (Gautier 1991): x_i + Σ β x_d for each independent
/// column i, the dependent columns d regrouped into them. Columns compete in units of their scales;
/// what the links absorb is regrouped too, but never leads.
/// @param R      (…, p) factor of all rows, in units of their noise
/// @param x      (p) parameters
/// @param scale  (p) how far they may be from their prior
std::vector<BaseParameter> base_parameters(const FitLayout& layout, const MatX<double>& R,
                                           const VecX<double>& x, const VecX<double>& scale);

}  // namespace diffnea
