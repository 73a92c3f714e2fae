#pragma once
/// The base model projected out: what is left of torques and of candidates' columns once the base
/// parameters have been fitted to them, within their prior. Internal to diagnose/.
///
/// Minimise ‖W(τ − X x − G ψ)‖² + ‖L(x − x₀)‖² over x for every ψ (variable projection, Golub and
/// Pereyra 1973): with A = [W X; L] and its orthonormal basis Q, G⊥ = (I − QQᵀ)[W G; 0] and r = (I
/// − QQᵀ)[W(τ − X x₀); 0]. Rows of a passive joint are those of M_jj(x₀)/M_jj(x) times its torque,
/// linear about x₀: torque that is zero fits any multiple of x, and the smallest would leave the
/// least. Where effects see a motion of their own (Evidence::apart()), their Q is that motion's.

#include "core/decompositions.hpp"
#include "diagnose/beside.hpp"
#include "diagnose/noise.hpp"

namespace diffnea {

/// Directions of the base below this share of the largest are dependent on the others to rounding.
inline constexpr double kRankTolerance = 1e-10;

/// What the base may do: Gaussian of the free parameters about x₀.
struct BasePrior {
  VecX<double> x0;        ///< (p)
  std::vector<int> free;  ///< columns that may move
  MatX<double> root;      ///< (any, free) L
};

class Projection {
 public:
  Projection(const Evidence& evidence, const Whitener& whitener, const BasePrior& prior);

  /// Columns of a candidate, whitened, beside the base.
  /// @param columns  (rows(), k)
  Beside beside(const MatX<double>& columns) const;
  /// The same of columns that reach some joints alone.
  /// @param rows  (joints · times(), k)
  Beside beside(std::vector<long> joints, const MatX<double>& rows) const;
  /// The same of many, in one pass over the basis.
  std::vector<Beside> beside(const std::vector<std::pair<std::vector<long>, const MatX<double>*>>&
                                 columns) const;
  /// Products of what the base leaves of columns with its residual, (k).
  VecX<double> with_residual(const Beside& columns) const;
  /// Columns beside the base, written out, (rows() + prior rows, k).
  MatX<double> expanded(const Beside& columns) const;
  MatX<double> project(const MatX<double>& columns) const { return expanded(beside(columns)); }
  const VecX<double>& residual() const { return residual_; }
  /// Base parameters that go with `effects`, the torque of all effects (rows()).
  VecX<double> parameters(const VecX<double>& effects) const { return solve(own_, effects); }
  /// The same of the motion that effects see. Its noise does not shrink them, as that of own
  /// accelerations does: they are what effects refer to.
  VecX<double> reference(const VecX<double>& effects) const { return solve(seen_, effects); }
  /// Root of what the fitted rows and the prior know of the free base parameters, (rank, free):
  /// moving by δ from where they have them costs ‖root δ‖².
  MatX<double> root() const;
  const BasePrior& prior() const { return prior_; }
  /// Orthonormal basis of the base as effects see it, (rows() + prior rows, rank).
  const MatX<double>& basis() const { return Q_; }
  /// Rank of the base.
  long rank() const { return Q_.cols(); }
  long rows() const { return whitener_.used_rows(); }
  const Whitener& whitener() const { return whitener_; }

 private:
  const Evidence& evidence_;
  const Whitener& whitener_;
  const BasePrior& prior_;
  MatX<double> Q_;  ///< of the base as effects see it
  struct Factor {
    Eigen::ColPivHouseholderQR<MatX<double>> qr;
    VecX<double> scale;
  };
  Factor factor(const MatX<double>& base) const;
  VecX<double> solve(const Factor& of, const VecX<double>& effects) const;

  Factor own_, seen_;
  VecX<double> residual_;
};

}  // namespace diffnea
