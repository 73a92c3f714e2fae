#pragma once

#include <diffnea/dynamics/driven_torques.hpp>

namespace diffnea::detail {

/// Smallest singular value of N_d, whose columns are at most 1 long, that is no dead point.
inline constexpr double kDeadPoint = 1e-6;

}  // namespace diffnea::detail

namespace diffnea {

inline MatX<double> driven_map(const MatX<double>& J, const std::vector<int>& driven) {
  const MatX<double> N = constraint_null_space(J);
  const auto count = static_cast<Eigen::Index>(driven.size());
  MatX<double> N_d(count, N.cols());
  for (Eigen::Index i = 0; i < count; ++i) {
    const int c = driven[static_cast<std::size_t>(i)];
    if (c < 0 || c >= J.cols())
      throw ShapeError("driven_map: coordinate " + std::to_string(c) +
                       " is driven, expected 0 to " + std::to_string(J.cols() - 1));
    N_d.row(i) = N.row(c);
  }
  const MatX<double> none(0, J.cols());
  if (count < N.cols() || N.cols() == 0) return none;
  const Eigen::JacobiSVD<MatX<double>> svd(N_d.transpose(),
                                           Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VecX<double>& s = svd.singularValues();
  if (!(s[N.cols() - 1] > detail::kDeadPoint)) return none;
  return svd.matrixV().leftCols(N.cols()) * s.head(N.cols()).cwiseInverse().asDiagonal() *
         svd.matrixU().transpose() * N.transpose();
}

}  // namespace diffnea
