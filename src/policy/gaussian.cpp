#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/gaussian.hpp>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

using Cholesky = Eigen::LLT<MatX<double>>;

/// Nothing if `m` is not positive definite. Eigen lets NaN pass.
std::optional<Cholesky> cholesky(const MatX<double>& m) {
  Cholesky out(m);
  const bool ok = out.info() == Eigen::Success && (out.matrixLLT().diagonal().array() > 0.0).all();
  return ok ? std::optional(std::move(out)) : std::nullopt;
}

Cholesky require_cholesky(const char* where, const MatX<double>& m) {
  std::optional<Cholesky> out = cholesky(m);
  if (!out) throw Error(std::string(where) + ": the covariance is not positive definite");
  return std::move(*out);
}

void require_shape(const char* where, const MatX<double>& m, long rows, long cols) {
  if (m.rows() == rows && m.cols() == cols) return;
  throw ShapeError(std::string(where) + ": got a matrix of " + std::to_string(m.rows()) + " x " +
                   std::to_string(m.cols()) + ", expected " + std::to_string(rows) + " x " +
                   std::to_string(cols));
}

void require_shape(const char* where, const Gaussian& g) {
  require_shape(where, g.covariance, g.size(), g.size());
}

}  // namespace

double Gaussian::entropy() const {
  require_shape("Gaussian::entropy", *this);
  const Cholesky L = require_cholesky("Gaussian::entropy", covariance);
  // ½ log det(2πe Σ)
  return 0.5 * size() * (1.0 + std::log(2.0 * std::numbers::pi)) +
         L.matrixLLT().diagonal().array().log().sum();
}

VecX<double> Gaussian::std() const { return covariance.diagonal().cwiseSqrt(); }

RowMatX<double> Gaussian::sample(int count, Rng& rng) const {
  require_shape("Gaussian::sample", *this);
  const Cholesky L = require_cholesky("Gaussian::sample", covariance);
  RowMatX<double> out(count, size());
  VecX<double> z(size());
  for (long i = 0; i < count; ++i) {
    for (double& x : z) x = rng.normal();
    out.row(i) = (mean + L.matrixL() * z).transpose();
  }
  return out;
}

double kl_divergence(const Gaussian& a, const Gaussian& b) {
  require_shape("kl_divergence", a);
  require_shape("kl_divergence", b);
  require_size("kl_divergence", a.size(), b.size(), "dimension");
  const std::optional<Cholesky> La = cholesky(a.covariance), Lb = cholesky(b.covariance);
  if (!La || !Lb) return std::numeric_limits<double>::infinity();
  // With M = L_b⁻¹ L_a, lower triangular: ½ (‖M‖² − d − Σ log M_ii² + ‖L_b⁻¹ (μ_b − μ_a)‖²). Summed
  // by entries, none of them negative, it is exact near 0, too.
  const MatX<double> M = Lb->matrixL().solve(MatX<double>(La->matrixL()));
  const VecX<double> shift = Lb->matrixL().solve(b.mean - a.mean);
  double sum =
      shift.squaredNorm() + M.triangularView<Eigen::StrictlyLower>().toDenseMatrix().squaredNorm();
  for (long i = 0; i < M.rows(); ++i) {
    const double x = (M(i, i) - 1.0) * (M(i, i) + 1.0);
    sum += std::max(0.0, x - std::log1p(x));
  }
  return 0.5 * sum;
}

Gaussian conditioned(const Gaussian& prior, const MatX<double>& A, const VecX<double>& y,
                     const MatX<double>& R) {
  require_shape("conditioned", prior);
  require_shape("conditioned", A, y.size(), prior.size());
  require_shape("conditioned", R, y.size(), y.size());
  const MatX<double> cross = prior.covariance * A.transpose();
  const Cholesky S = require_cholesky("conditioned", A * cross + R);
  const MatX<double> K = S.solve(cross.transpose()).transpose();
  // Joseph's form: positive definite under rounding, too.
  const MatX<double> keep = MatX<double>::Identity(prior.size(), prior.size()) - K * A;
  const MatX<double> covariance =
      keep * prior.covariance * keep.transpose() + K * R * K.transpose();
  return {prior.mean + K * (y - A * prior.mean), 0.5 * (covariance + covariance.transpose())};
}

}  // namespace diffnea
