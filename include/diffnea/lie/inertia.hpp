#pragma once
/// Spatial inertia M̄ = [[J, m[p]], [m[p]ᵀ, m I]] of one link, and the articulated inertia of a
/// subtree.

#include <array>

#include <diffnea/lie/se3.hpp>

namespace diffnea {

/// Order of the ten inertial parameters everywhere: θ = [m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz,
/// Izz], h = m·p_com [kg·m], I about the link origin [kg·m²]; linear in every torque.
inline constexpr int kThetaSize = 10;
/// Names of the entries of θ, in their order.
inline constexpr const char* kThetaNames[kThetaSize] = {"mass", "hx",  "hy",  "hz",  "Ixx",
                                                        "Ixy",  "Ixz", "Iyy", "Iyz", "Izz"};
/// [m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz] of a link about its origin [kg, kg·m, kg·m²].
template <class T>
using Theta = std::array<T, kThetaSize>;

/// Ten inertial parameters of a rigid body about its frame's origin, in its frame.
template <class T>
struct SpatialInertia {
  T m{};      ///< mass [kg]
  Vec3<T> h;  ///< first moment of mass m·p_com [kg·m]
  Sym3<T> I;  ///< rotational inertia about the frame's origin [kg·m²]

  /// From the ten numbers, in the order of `Theta`.
  static SpatialInertia from_theta(const Theta<T>& t) {
    return {t[0], {t[1], t[2], t[3]}, {t[4], t[5], t[6], t[7], t[8], t[9]}};
  }
  /// The ten numbers, in the order of `Theta`.
  Theta<T> theta() const { return {m, h.x, h.y, h.z, I.xx, I.xy, I.xz, I.yy, I.yz, I.zz}; }
};

/// Two bodies as one; both in the same frame.
template <class T>
SpatialInertia<T> operator+(const SpatialInertia<T>& a, const SpatialInertia<T>& b) {
  return {a.m + b.m, a.h + b.h, a.I + b.I};
}

/// M̄ V = [I ω + h×v; m v − h×ω].
template <class A, class B>
Wrench<Prod<A, B>> operator*(const SpatialInertia<A>& M, const Twist<B>& V) {
  return {M.I * V.angular + cross(M.h, V.linear), V.linear * M.m - cross(M.h, V.angular)};
}

/// −[a][b] − [b][a] as a symmetric matrix: 2(a·b) 1 − a bᵀ − b aᵀ.
template <class T>
Sym3<T> minus_skew_product(const Vec3<T>& a, const Vec3<T>& b) {
  const T xx = a.x * b.x, yy = a.y * b.y, zz = a.z * b.z;
  return {T(2.0) * (yy + zz), -(a.x * b.y + b.x * a.y), -(a.x * b.z + b.x * a.z),
          T(2.0) * (xx + zz), -(a.y * b.z + b.y * a.z), T(2.0) * (xx + yy)};
}

/// The same body seen from A, X_AB the pose of its frame B. Exact in all ten parameters.
template <class A, class B>
SpatialInertia<Prod<A, B>> to_parent(const Pose<A>& X_AB, const SpatialInertia<B>& M) {
  using T = Prod<A, B>;
  const Vec3<T> Rh = X_AB.R * M.h;
  const Vec3<T> p = X_AB.p.template cast<T>();
  const T m = T(M.m);
  // I_A = R I Rᵀ − [p][Rh] − [Rh][p] − m[p][p]
  const Sym3<T> shift = minus_skew_product(p, Rh) + minus_skew_product(p, p * (T(0.5) * m));
  return {m, Rh + p * m, rotate(X_AB.R, M.I) + shift};
}

/// θ from mass, centre of mass and the rotational inertia about the centre of mass, axes of the
/// link: I = I_C − m[p][p] (the paper prints +, corrected).
template <class T>
SpatialInertia<T> inertia_from_com(const T& m, const Vec3<T>& p_com, const Sym3<T>& I_com) {
  return {m, p_com * m, I_com + minus_skew_product(p_com, p_com * (T(0.5) * m))};
}
/// Inverse of inertia_from_com for the rotational part; needs m ≠ 0.
template <class T>
Sym3<T> inertia_about_com(const SpatialInertia<T>& M) {
  const Vec3<T> p = M.h * (T(1.0) / M.m);
  return M.I - minus_skew_product(p, p * (T(0.5) * M.m));
}

/// M̂ of a subtree: [[I, H], [Hᵀ, M]], symmetric 6×6 (21 numbers).
template <class T>
struct ArticulatedInertia {
  Sym3<T> I;  ///< torque per angular acceleration [kg·m²]
  Mat3<T> H;  ///< torque per linear acceleration [kg·m]; [h] of a rigid body
  Sym3<T> M;  ///< force per linear acceleration [kg]; m 1 of a rigid body

  /// That of a rigid body.
  template <class U>
  static ArticulatedInertia from_rigid(const SpatialInertia<U>& b) {
    const T m(b.m), o(0.0);
    return {b.I.template cast<T>(), skew(b.h.template cast<T>()), {m, o, o, m, o, m}};
  }
};

/// Two subtrees as one; both in the same frame.
template <class A, class B>
ArticulatedInertia<Prod<A, B>> operator+(const ArticulatedInertia<A>& a,
                                         const ArticulatedInertia<B>& b) {
  return {a.I + b.I, a.H + b.H, a.M + b.M};
}

/// M̂ V = [I ω + H v; Hᵀ ω + M v].
template <class A, class B>
Wrench<Prod<A, B>> operator*(const ArticulatedInertia<A>& M, const Twist<B>& V) {
  return {M.I * V.angular + M.H * V.linear, transpose_times(M.H, V.angular) + M.M * V.linear};
}

/// M̂ − U Ψ Uᵀ.
template <class T>
ArticulatedInertia<T> rank_one_down(const ArticulatedInertia<T>& A, const Wrench<T>& U,
                                    const T& psi) {
  const Vec3<T> f = U.force * psi;
  const Mat3<T> nf = {U.torque * f.x, U.torque * f.y, U.torque * f.z};
  return {A.I - outer(U.torque, psi), A.H - nf, A.M - outer(U.force, psi)};
}

/// Ad*_{X_BA} A Ad_{X_BA}: the inertia of B's subtree seen from A.
template <class T>
ArticulatedInertia<T> to_parent(const Pose<T>& X_AB, const ArticulatedInertia<T>& A) {
  const Sym3<T> M = rotate(X_AB.R, A.M);
  const Mat3<T> H0 = X_AB.R * A.H * transpose(X_AB.R);
  const Mat3<T> Mf = full(M);
  // H = H₀ + [p] M;   I = R I Rᵀ − H₀[p] + [p] Hᵀ
  const Vec3<T>& p = X_AB.p;
  const Mat3<T> H = H0 + Mat3<T>{cross(p, Mf.col[0]), cross(p, Mf.col[1]), cross(p, Mf.col[2])};
  const Mat3<T> H0t = transpose(H0), Ht = transpose(H);
  // −H₀[p] = ([p] H₀ᵀ)ᵀ
  const Mat3<T> a =
      transpose(Mat3<T>{cross(p, H0t.col[0]), cross(p, H0t.col[1]), cross(p, H0t.col[2])});
  const Mat3<T> b = {cross(p, Ht.col[0]), cross(p, Ht.col[1]), cross(p, Ht.col[2])};
  return {rotate(X_AB.R, A.I) + upper(a + b), H, M};
}

}  // namespace diffnea
