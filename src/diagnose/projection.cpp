#include "diagnose/projection.hpp"

namespace diffnea {
Projection::Projection(const Evidence& evidence, const Whitener& whitener, const BasePrior& prior)
    : evidence_(evidence), whitener_(whitener), prior_(prior) {
  const long n = evidence.rows(), p = std::ssize(prior.free), l = prior.root.rows();
  VecX<double> y = VecX<double>::Zero(n + l);
  y.head(n) = whitener(evidence.torque() - evidence.base() * prior.x0);
  Q_.resize(n + l, 0);
  if (p > 0) {
    const auto basis = [&](const Factor& f) {
      return columns_of_q(f.qr.householderQ(), n + l, f.qr.rank());
    };
    own_ = factor(evidence.base());
    seen_ = evidence.apart() ? factor(evidence.seen_base()) : own_;
    const MatX<double> own = basis(own_);
    Q_ = evidence.apart() ? basis(seen_) : own;
    y -= own * (own.transpose() * y).eval();
  }
  residual_ = y - Q_ * (Q_.transpose() * y).eval();
}

Beside Projection::beside(const MatX<double>& columns) const {
  const long m = evidence_.times();
  std::vector<long> joints;
  for (long k = 0; k < evidence_.rows() / m; ++k)
    if (columns.cols() > 0 && !columns.middleRows(k * m, m).isZero(0.0)) joints.push_back(k);
  MatX<double> rows(m * std::ssize(joints), columns.cols());
  for (std::size_t i = 0; i < joints.size(); ++i)
    rows.middleRows(i * m, m) = columns.middleRows(joints[i] * m, m);
  return beside(std::move(joints), rows);
}

Beside Projection::beside(std::vector<long> joints, const MatX<double>& rows) const {
  return std::move(beside({{std::move(joints), &rows}}).front());
}

std::vector<Beside> Projection::beside(
    const std::vector<std::pair<std::vector<long>, const MatX<double>*>>& columns) const {
  constexpr long kAtOnce = 256;  // columns: enough to read the basis once for many
  const long m = evidence_.times();
  std::vector<Beside> out;
  std::vector<std::vector<std::pair<std::size_t, long>>> of_joint(
      static_cast<std::size_t>(evidence_.rows() / m));  // index into columns, first row
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const auto& [joints, rows] = columns[c];
    out.push_back({joints, MatX<double>(rows->rows(), rows->cols()),
                   MatX<double>::Zero(Q_.cols(), rows->cols())});
    for (std::size_t i = 0; i < joints.size(); ++i)
      of_joint[joints[i]].emplace_back(c, static_cast<long>(i) * m);
  }
  for (std::size_t k = 0; k < of_joint.size(); ++k)
    for (std::size_t first = 0; first < of_joint[k].size();) {
      std::size_t end = first;
      long width = 0;
      for (; end < of_joint[k].size() && width < kAtOnce; ++end)
        width += out[of_joint[k][end].first].cols();
      MatX<double> block(m, width);
      width = 0;
      for (std::size_t i = first; i < end; ++i) {
        const auto& [c, row] = of_joint[k][i];
        const long w = out[c].cols();
        block.middleCols(width, w) = whitener_.joint(k, columns[c].second->middleRows(row, m));
        out[c].whitened.middleRows(row, m) = block.middleCols(width, w);
        width += w;
      }
      const MatX<double> onto = Q_.middleRows(k * m, m).transpose() * block;
      width = 0;
      for (std::size_t i = first; i < end; ++i) {
        Beside& of = out[of_joint[k][i].first];
        of.onto += onto.middleCols(width, of.cols());
        width += of.cols();
      }
      first = end;
    }
  return out;
}

VecX<double> Projection::with_residual(const Beside& columns) const {
  const long m = evidence_.times();
  VecX<double> out = VecX<double>::Zero(columns.cols());
  for (std::size_t i = 0; i < columns.joints.size(); ++i)
    out.noalias() += columns.of(i).transpose() * residual_.segment(columns.joints[i] * m, m);
  return out;
}

MatX<double> Projection::expanded(const Beside& columns) const {
  const long m = evidence_.times();
  MatX<double> out = MatX<double>::Zero(residual_.size(), columns.cols());
  for (std::size_t i = 0; i < columns.joints.size(); ++i)
    out.middleRows(columns.joints[i] * m, m) = columns.of(i);
  if (columns.cols() > 0 && Q_.cols() > 0) out.noalias() -= Q_ * columns.onto;
  return out;
}

Projection::Factor Projection::factor(const MatX<double>& base) const {
  Factor out;
  const long n = evidence_.rows();
  MatX<double> A(n + prior_.root.rows(), std::ssize(prior_.free));
  A.topRows(n) = whitener_(evidence_.without_scale(base, prior_.x0, prior_.free));
  A.bottomRows(prior_.root.rows()) = prior_.root;
  out.scale = A.colwise().norm().transpose();
  for (double& s : out.scale) s = s > 0.0 ? 1.0 / s : 1.0;
  A = A * out.scale.asDiagonal();
  out.qr.setThreshold(kRankTolerance);
  out.qr.compute(A);
  return out;
}

MatX<double> Projection::root() const {
  if (prior_.free.empty()) return {};
  MatX<double> out = own_.qr.matrixR().topRows(own_.qr.rank()).triangularView<Eigen::Upper>();
  out = out * own_.qr.colsPermutation().transpose();
  return out * own_.scale.cwiseInverse().asDiagonal();
}

VecX<double> Projection::solve(const Factor& of, const VecX<double>& effects) const {
  VecX<double> x = prior_.x0;
  if (prior_.free.empty()) return x;
  VecX<double> y = VecX<double>::Zero(evidence_.rows() + prior_.root.rows());
  y.head(evidence_.rows()) = whitener_(evidence_.torque() - evidence_.base() * prior_.x0 - effects);
  const VecX<double> step = of.scale.cwiseProduct(of.qr.solve(y));
  for (std::size_t k = 0; k < prior_.free.size(); ++k) x[prior_.free[k]] += step[k];
  return x;
}

}  // namespace diffnea
