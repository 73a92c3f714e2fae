#pragma once

#include <algorithm>
#include <cmath>

#include <diffnea/core/compiled.hpp>
#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/model/physical.hpp>

namespace diffnea {
namespace detail {

inline Eigen::Matrix3d matrix(const Sym3<double>& s) {
  Eigen::Matrix3d m;
  m << s.xx, s.xy, s.xz, s.xy, s.yy, s.yz, s.xz, s.yz, s.zz;
  return m;
}

}  // namespace detail

DIFFNEA_INLINE Eigen::Matrix4d pseudo_inertia(const Theta<double>& theta) {
  const SpatialInertia<double> b = SpatialInertia<double>::from_theta(theta);
  const Eigen::Matrix3d I = detail::matrix(b.I);
  Eigen::Matrix4d Pi;
  Pi.topLeftCorner<3, 3>() = 0.5 * I.trace() * Eigen::Matrix3d::Identity() - I;
  Pi.topRightCorner<3, 1>() = to_eigen(b.h);
  Pi.bottomLeftCorner<1, 3>() = to_eigen(b.h).transpose();
  Pi(3, 3) = b.m;
  return Pi;
}

DIFFNEA_INLINE double smallest_pseudo_inertia_eigenvalue(const Theta<double>& theta) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(pseudo_inertia(theta),
                                                        Eigen::EigenvaluesOnly)
      .eigenvalues()[0];
}

DIFFNEA_INLINE double triangle_margin(const SpatialInertia<double>& inertia) {
  const Eigen::Vector3d J = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(
                                detail::matrix(inertia_about_com(inertia)), Eigen::EigenvaluesOnly)
                                .eigenvalues();
  return J[0] + J[1] - J[2];  // eigenvalues ascend: the largest against the other two
}

DIFFNEA_INLINE Theta<double> virtual_from_theta(const Theta<double>& theta) {
  const auto body = SpatialInertia<double>::from_theta(theta);
  if (!(body.m > 0.0))
    throw ModelError("virtual_from_theta: mass " + detail::number_text(body.m) +
                     " kg, expected > 0");
  // Second moments about the centre of mass: Σ_C = ½ tr(I_C) 1 − I_C, principal values L ≥ 0.
  const Eigen::Matrix3d I = detail::matrix(inertia_about_com(body));
  const Eigen::Matrix3d Sigma = 0.5 * I.trace() * Eigen::Matrix3d::Identity() - I;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(Sigma);
  const Eigen::Vector3d L = eigen.eigenvalues().reverse();
  const double tolerance =
      1e-12 * std::max(I.trace(), 1e-300);  // rounding of the parallel-axis shift
  if (L[2] < -tolerance)
    throw ModelError("virtual_from_theta: principal second moment " + detail::number_text(L[2]) +
                     " kg·m², expected >= 0 (the inertia misses the triangle inequality by " +
                     detail::number_text(-2 * L[2]) + ")");
  Eigen::Matrix3d R = eigen.eigenvectors().rowwise().reverse();
  if (R.determinant() < 0) R.col(2) *= -1;
  const Vec3<double> rpy = rpy_from_rotation(mat3<double>(R));
  const auto root = [](double x) { return std::sqrt(std::max(x, 0.0)); };
  return {root(L[0]), root(L[1]), root(L[2]),        std::sqrt(body.m), rpy.x,
          rpy.y,      rpy.z,      body.h.x / body.m, body.h.y / body.m, body.h.z / body.m};
}

DIFFNEA_INLINE Theta<double> log_cholesky_from_theta(const Theta<double>& theta) {
  // Π = U Uᵀ with U upper triangular: Cholesky of Π with rows and columns reversed.
  const Eigen::Matrix4d reversed = pseudo_inertia(theta).reverse();
  const Eigen::LLT<Eigen::Matrix4d> llt(reversed);
  if (!(theta[0] > 0.0) || llt.info() != Eigen::Success)
    throw ModelError("log_cholesky_from_theta: smallest eigenvalue of the pseudo-inertia is " +
                     detail::number_text(smallest_pseudo_inertia_eigenvalue(theta)) +
                     ", expected > 0 (mass and all principal second moments positive)");
  const Eigen::Matrix4d U = Eigen::Matrix4d(llt.matrixL()).reverse();
  const double s = U(3, 3);
  return {std::log(s),           std::log(U(0, 0) / s),
          std::log(U(1, 1) / s), std::log(U(2, 2) / s),
          U(0, 1) / s,           U(1, 2) / s,
          U(0, 2) / s,           U(0, 3) / s,
          U(1, 3) / s,           U(2, 3) / s};
}

DIFFNEA_INLINE ThetaJacobian theta_with_jacobian(InertiaCoordinates form,
                                                 const Theta<double>& phi) {
  using Jet = ceres::Jet<double, kThetaSize>;
  Theta<Jet> x;
  for (int i = 0; i < kThetaSize; ++i) x[i] = Jet(phi[i], i);
  const Theta<Jet> y =
      form == InertiaCoordinates::kVirtual ? theta_from_virtual(x) : theta_from_log_cholesky(x);
  ThetaJacobian out{{}, Eigen::MatrixXd(kThetaSize, kThetaSize)};
  for (int i = 0; i < kThetaSize; ++i) {
    out.theta[i] = y[i].a;
    out.jacobian.row(i) = y[i].v.transpose();
  }
  return out;
}

}  // namespace diffnea
