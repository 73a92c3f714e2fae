#pragma once
/// Physically consistent inertial parameters: maps from unrestricted coordinates to θ that only
/// reach bodies some distribution of positive mass can have, and back. Both forms of the
/// literature:
///
///  * virtual parameters (paper, appendix "Virtual Physical Parameters"):
///      φ = [√L1, √L2, √L3, √m, roll, pitch, yaw, px, py, pz], J_p = diag(L2+L3, L1+L3, L1+L2),
///      I = R J_p Rᵀ − m[p][p] (the print's + corrected);
///  * log-Cholesky (Rucker & Wensing 2022, "Smooth Parameterization of Rigid-Body Inertia", eq.
///  7–9):
///      φ = [α, d1, d2, d3, s12, s23, s13, t1, t2, t3], pseudo-inertia Π = U Uᵀ,
///      U = e^α [[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]].

#include <Eigen/Dense>

#include <diffnea/lie/inertia.hpp>

namespace diffnea {

/// Coordinates in which every point is a body that can exist.
enum class InertiaCoordinates { kVirtual, kLogCholesky };

/// θ(φ) for any scalar.
template <Scalar T>
Theta<T> theta_from_virtual(const Theta<T>& phi);
/// θ of log-Cholesky coordinates (Rucker, Wensing 2022).
template <Scalar T>
Theta<T> theta_from_log_cholesky(const Theta<T>& phi);

/// Inverse maps. For the virtual parameters the principal axes are sorted so that L1 ≥ L2 ≥ L3.
/// @throws ModelError if θ is not physically consistent (log-Cholesky: strictly; virtual: the
/// boundary,
///         a point mass, is allowed)
Theta<double> virtual_from_theta(const Theta<double>& theta);
/// The inverse. @throws ModelError if no body has this θ
Theta<double> log_cholesky_from_theta(const Theta<double>& theta);

/// θ(φ) and its Jacobian ∂θ/∂φ (10×10).
struct ThetaJacobian {
  Theta<double> theta;       ///< θ(φ)
  Eigen::MatrixXd jacobian;  ///< ∂θ/∂φ, (10, 10), row: entry of θ
};
/// θ and ∂θ/∂φ, (10, 10).
ThetaJacobian theta_with_jacobian(InertiaCoordinates form, const Theta<double>& phi);

/// Pseudo-inertia Π (4×4): [[Σ, h], [hᵀ, m]], Σ = ½ tr(I) 1 − I. θ is physically consistent exactly
/// if Π ⪰ 0 (Wensing, Kim, Slotine 2018).
Eigen::Matrix4d pseudo_inertia(const Theta<double>& theta);
/// Smallest eigenvalue of Π; negative: impossible.
double smallest_pseudo_inertia_eigenvalue(const Theta<double>& theta);
/// How far the rotational inertia about the centre of mass misses the triangle inequality [kg·m²]:
/// min over axes of (J_x + J_y − J_z), principal moments; negative: impossible.
double triangle_margin(const SpatialInertia<double>& inertia);

}  // namespace diffnea

#include <diffnea/model/detail/physical_impl.hpp>
#ifndef DIFFNEA_COMPILED
#include <diffnea/model/detail/physical_values_impl.hpp>
#endif
