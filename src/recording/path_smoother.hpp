#pragma once
/// Positions without noise, and their derivatives, at every row of a stretch, ends included.
///
/// Smoothing spline of order 8: minimises Σ (y_k − q_k)² + λ ∫ (d⁴q/dt⁴)² dt, which is the smoother
/// of a path whose fourth derivative is white (Wahba 1978). Away from the ends it is a low-pass of
/// gain 1/(1 + (ω/ω_c)⁸) and no phase, as Butterworth's of order 4 both ways. At the ends nothing
/// is continued: a polynomial of degree 3 passes unchanged, and five rows are enough.
///
/// By orthogonal transformations (Paige, Saunders 1977), of which none depends on the data: those
/// of the first rows are made once, and those of the rest are all alike.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea::detail {

/// Rows that a spline of order 8 needs.
inline constexpr long kFewestPathRows = 5;

class PathSmoother {
 public:
  /// @param cutoff_hz  where the gain is ½. Far below the rate, where rounding would grow with the
  ///   fourth power of their ratio, means of several rows are what is smoothed.
  /// @throws DataError unless 0 < cut-off < half of the rate
  PathSmoother(double cutoff_hz, double rate_hz)
      : PathSmoother(cutoff_hz, rate_hz, rows_at_once(cutoff_hz, rate_hz)) {}

  /// @param y  (K, n) positions, K ≥ kFewestPathRows
  /// @param q, qd, qdd  (K, n) of the path; written
  void smooth(const Eigen::Ref<const RowMatX<double>>& y, RowMatX<double>& q, RowMatX<double>& qd,
              RowMatX<double>& qdd) const;

  /// Rows after which an end is forgotten to the share.
  long memory(double share) const;

  /// Rows of one mean: stretches that begin at a multiple of it have the same path.
  long every() const { return every_; }

  /// Variance of the acceleration at each of K rows [1/s⁴], of positions whose noise has variance
  /// 1: many times larger at the ends.
  VecX<double> acceleration_variance(long rows) const;

 private:
  using Square = Eigen::Matrix<double, 4, 4>;
  PathSmoother(double cutoff_hz, double rate_hz, long every);
  static long rows_at_once(double cutoff_hz, double rate_hz);
  /// Elimination of one row's state z: R z + S z⁺ = c, and what is known of z⁺ by then.
  struct Step {
    Square inverse, next;                    ///< R⁻¹, R⁻¹ S
    Eigen::Matrix<double, 4, 5> solved;      ///< [b; y] → R⁻¹ c
    Eigen::Matrix<double, 4, 5> information; ///< [b; y] → b⁺
    Square root;                             ///< A⁺, upper triangular: A⁺ z⁺ = b⁺
  };
  /// @param before  known of the row's state; null: nothing
  Step eliminate(const Square* before) const;
  const Step& step(long row) const {
    const std::size_t k = static_cast<std::size_t>(row);
    return k < steps_.size() ? steps_[k] : steps_.back();
  }
  /// Factor of the last row: what is known of it and its own position. R, of R z = Q [b; y].
  Square last(long row, Eigen::Matrix<double, 4, 5>& q) const;

  double cutoff_hz_, rate_hz_;  ///< rate of the means
  long every_;
  Eigen::RowVector4d shown_;  ///< row of a mean in the state
  Square advance_, weight_;  ///< z⁺ = F z + noise; root of that noise's inverse covariance
  std::vector<Step> steps_;  ///< until they no longer change
};

}  // namespace diffnea::detail
