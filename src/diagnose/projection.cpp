#include "diagnose/projection.hpp"

namespace diffnea {
namespace {

/// Directions of the base below this share of the largest are dependent on the others to rounding.
constexpr double kRankTolerance = 1e-10;

}  // namespace

Projection::Projection(const Evidence& evidence, const Whitener& whitener, const BasePrior& prior)
    : evidence_(evidence), whitener_(whitener), prior_(prior) {
  const long n = evidence.rows(), p = static_cast<long>(prior.free.size()), l = prior.root.rows();
  VecX<double> y = VecX<double>::Zero(n + l);
  y.head(n) = whitener(evidence.torque() - evidence.base() * prior.x0);
  Q_.resize(n + l, 0);
  if (p > 0) {
    const auto factor = [&](const MatX<double>& base) {
      MatX<double> A(n + l, p);
      A.topRows(n) = whitener(base(Eigen::all, prior.free));
      A.bottomRows(l) = prior.root;
      scale_ = A.colwise().norm().transpose();
      for (double& s : scale_) s = s > 0.0 ? 1.0 / s : 1.0;
      A = A * scale_.asDiagonal();
      qr_.setThreshold(kRankTolerance);
      qr_.compute(A);
      return MatX<double>(qr_.householderQ() * MatX<double>::Identity(n + l, qr_.rank()));
    };
    if (evidence.averaged()) Q_ = factor(evidence.averaged_base());
    const MatX<double> own = factor(evidence.base());  // last: parameters() solves with it
    if (!evidence.averaged()) Q_ = own;
    y -= own * (own.transpose() * y).eval();
  }
  residual_ = y - Q_ * (Q_.transpose() * y).eval();
}

MatX<double> Projection::project(const MatX<double>& columns) const {
  return project_whitened(whitener_(columns));
}

MatX<double> Projection::project_whitened(MatX<double> columns) const {
  const long n = columns.rows();
  columns.conservativeResize(n + prior_.root.rows(), Eigen::NoChange);
  columns.bottomRows(prior_.root.rows()).setZero();
  if (Q_.cols() > 0)
    for (int twice = 0; twice < 2; ++twice)  // once more: orthogonal to rounding (Kahan, Parlett)
      columns.noalias() -= Q_ * (Q_.transpose() * columns).eval();
  return columns;
}

VecX<double> Projection::parameters(const VecX<double>& effects) const {
  VecX<double> x = prior_.x0;
  if (prior_.free.empty()) return x;
  VecX<double> y = VecX<double>::Zero(Q_.rows());
  y.head(evidence_.rows()) = whitener_(evidence_.torque() - evidence_.base() * prior_.x0 - effects);
  const VecX<double> step = scale_.cwiseProduct(qr_.solve(y));
  for (std::size_t k = 0; k < prior_.free.size(); ++k)
    x[prior_.free[k]] += step[static_cast<long>(k)];
  return x;
}

}  // namespace diffnea
