#pragma once

#include <diffnea/model/physical.hpp>

namespace diffnea {

template <Scalar T>
Theta<T> theta_from_virtual(const Theta<T>& phi) {
  const T L1 = phi[0] * phi[0], L2 = phi[1] * phi[1], L3 = phi[2] * phi[2];
  const T m = phi[3] * phi[3];
  const Mat3<T> R = rotation_from_rpy<T>({phi[4], phi[5], phi[6]});
  const Sym3<T> J_p{L2 + L3, T(0.0), T(0.0), L1 + L3, T(0.0), L1 + L2};
  return inertia_from_com<T>(m, {phi[7], phi[8], phi[9]}, rotate(R, J_p)).theta();
}

template <Scalar T>
Theta<T> theta_from_log_cholesky(const Theta<T>& phi) {
  using std::exp;
  const T scale = exp(T(2.0) * phi[0]);
  const T d1 = exp(phi[1]), d2 = exp(phi[2]), d3 = exp(phi[3]);
  const T &s12 = phi[4], &s23 = phi[5], &s13 = phi[6];
  const T &t1 = phi[7], &t2 = phi[8], &t3 = phi[9];
  // Π = U Uᵀ without the factor e^{2α}
  const T Sxx = d1 * d1 + s12 * s12 + s13 * s13 + t1 * t1;
  const T Syy = d2 * d2 + s23 * s23 + t2 * t2;
  const T Szz = d3 * d3 + t3 * t3;
  const T Sxy = s12 * d2 + s13 * s23 + t1 * t2;
  const T Sxz = s13 * d3 + t1 * t3;
  const T Syz = s23 * d3 + t2 * t3;
  // I = tr(Σ) 1 − Σ
  return {scale,        scale * t1,   scale * t2,          scale * t3,   scale * (Syy + Szz),
          -scale * Sxy, -scale * Sxz, scale * (Sxx + Szz), -scale * Syz, scale * (Sxx + Syy)};
}

}  // namespace diffnea
