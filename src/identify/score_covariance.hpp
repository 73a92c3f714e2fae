#pragma once
/// The middle of the sandwich where residuals are autocorrelated (Newey, West 1987). Internal to
/// identify/.

#include <diffnea/identify/torque_regression.hpp>

namespace diffnea {

/// Σ of score products of one joint's rows over lags, for rows [Y | τ] over sigma: what takes the
/// place of YᵀY. Scaled up to all rows where only some were kept.
/// @param T  what the rows are multiplied with first (Gains::linearisation)
MatX<double> score_covariance(const JointRows& kept, const MatX<double>& T, const VecX<double>& x,
                              double sigma, double all_rows);

}  // namespace diffnea
