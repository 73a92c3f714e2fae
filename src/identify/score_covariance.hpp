#pragma once
/// The middle of the sandwich where residuals are autocorrelated (Newey, West 1987) and a loss may
/// weigh them (Huber 1964). Internal to identify/.

#include <functional>

#include <diffnea/identify/torque_regression.hpp>

#include "identify/robust_loss.hpp"

namespace diffnea {

/// Σ of score products of one joint's rows over lags, for rows [Y | τ] over sigma: what takes the
/// place of YᵀWY. Lags are those of time, up to the root of the number of rows, and end with a run;
/// a row that was left out (a rest, a pause) counts as a score of 0. Scaled up, run by run, where
/// not all rows were kept. Of weighted rows also by the square of Σ weight over Σ slope: what the
/// fit's YᵀWY stands for is Y' diag(ψ') Y.
/// @param T  what the rows are multiplied with first (Gains::linearisation)
/// @param influence  of the loss; empty: squares
MatX<double> score_covariance(const JointRows& kept, const MatX<double>& T, const VecX<double>& x,
                              double sigma, const std::function<Influence(double)>& influence = {});

}  // namespace diffnea
