#pragma once
/// Gaussian over the parameters of a policy.

#include <diffnea/core/random.hpp>
#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// A normal distribution of a movement's parameters.
struct Gaussian {
  VecX<double> mean;        ///< (d)
  MatX<double> covariance;  ///< (d × d), positive definite

  /// Number of parameters.
  int size() const { return static_cast<int>(mean.size()); }
  /// [nat] @throws ShapeError; Error if the covariance is not positive definite
  double entropy() const;
  VecX<double> std() const;  ///< of every parameter
  /// (count × d), one sample a row. @throws Error if the covariance is not positive definite
  RowMatX<double> sample(int count, Rng& rng) const;
};

/// KL(a ‖ b) [nat]; +∞ if a covariance is not positive definite. @throws ShapeError
double kl_divergence(const Gaussian& a, const Gaussian& b);

/// Conditioned on A θ = y up to noise of covariance R: a via-point (Paraschos et al. 2013, eq.
/// 5–6).
/// @param A (m × d)  @param y (m)  @param R (m × m)
/// @throws ShapeError; Error if A Σ Aᵀ + R is not positive definite
Gaussian conditioned(const Gaussian& prior, const MatX<double>& A, const VecX<double>& y,
                     const MatX<double>& R);

}  // namespace diffnea
