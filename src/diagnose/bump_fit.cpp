#include "diagnose/bump_fit.hpp"

#include <algorithm>
#include <cmath>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

/// s in units of what the whitened rows of one bump see; a decade each way is enough on any data.
const std::vector<double> kDeviations = log_grid(1e-2, 1e4, 25);
/// Of the protected columns' inner products with bumps: below, they are rounding.
constexpr double kDependent = 1e-9;

/// Orthonormal basis of the weights w with A w = 0.
MatX<double> free_directions(const MatX<double>& A) {
  const long n = A.cols();
  if (A.rows() == 0) return MatX<double>::Identity(n, n);
  Eigen::ColPivHouseholderQR<MatX<double>> qr(A.transpose());
  qr.setThreshold(kDependent);
  return columns_of_q(qr.householderQ(), n, n).rightCols(n - qr.rank());
}

}  // namespace

BumpRows::BumpRows(const Search& search, const std::vector<Term>& terms, const VecX<double>& beside,
                   long joint)
    : search_(search),
      joint_(joint),
      begin_(joint * search.evidence().times()),
      m_(search.evidence().times()) {
  const Projection& projection = search.projection();
  left_ = projection.residual() - projection.project(beside);
  MatX<double> C(left_.size(), 0);
  const auto add = [&](const MatX<double>& columns) {
    C.conservativeResize(Eigen::NoChange, C.cols() + columns.cols());
    C.rightCols(columns.cols()) = columns;
  };
  for (const Term& t : terms) {
    const MatX<double> columns = projection.expanded(t.beside);
    left_ -= columns.leftCols(t.width()) * t.values();
    if (t.has_offset()) left_ -= columns.col(t.width());
    add(columns.leftCols(t.width()));
    if (!t.shapes.empty()) add(projection.project(search.evidence().columns(t.effect, t.shapes)));
  }
  const auto of_joint = [&](const MatX<double>& rows) {
    return rows.cols() > 0 ? MatX<double>(rows.middleRows(begin_, m_)) : MatX<double>(m_, 0);
  };
  protected_ = of_joint(C);
  base_ = of_joint(projection.basis());
}

BumpWeights BumpRows::fit(const MatX<double>& columns) const {
  const MatX<double> white = search_.whitener().joint(joint_, columns);
  const MatX<double> onto = base_.transpose() * white;
  MatX<double> K = white.transpose() * white - onto.transpose() * onto;
  VecX<double> b = white.transpose() * left_.segment(begin_, m_);
  const MatX<double> N = free_directions(protected_.transpose() * white);
  K = N.transpose() * K * N;
  b = N.transpose() * b;
  BumpWeights best;
  if (N.cols() == 0) return best;
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(K);
  const VecX<double> l = eigen.eigenvalues().cwiseMax(0.0),
                     c = eigen.eigenvectors().transpose() * b;
  const double chi2 = left_.squaredNorm(), unit = 1.0 / std::max(l.mean(), 1e-300);
  for (const double d : kDeviations) {
    const double s2 = d * unit;
    const VecX<double> posterior = (l.array() + 1.0 / s2).inverse();
    const double penalised = chi2 - c.dot(posterior.cwiseProduct(c));
    const double cost = search_.cost(penalised) + (1.0 + s2 * l.array()).log().sum();
    if (cost >= best.cost) continue;
    best.cost = cost;
    const VecX<double> z = posterior.cwiseProduct(c);
    best.gain = 2.0 * z.dot(c) - z.dot(l.cwiseProduct(z));
    best.parameters = l.cwiseProduct(posterior).sum();
    best.weights = N * (eigen.eigenvectors() * z);
    best.root = N * eigen.eigenvectors() * posterior.cwiseSqrt().asDiagonal();
  }
  return best;
}

}  // namespace diffnea
