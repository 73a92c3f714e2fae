#pragma once
/// Motion subspace s of a revolute joint along a coordinate axis, s = [e_K; 0], as a type: products
/// with it pick components, so that the recursions read as for any s and compute what differs from
/// zero.

#include <diffnea/lie/inertia.hpp>

namespace diffnea {

/// s = [e_K; 0] itself; K = 0, 1, 2 is x, y, z of the link.
template <int K>
struct RevoluteAxis {};

/// e_K · v.
template <int K, class T>
const T& component(const Vec3<T>& v) {
  return K == 0 ? v.x : K == 1 ? v.y : v.z;
}
/// The entry of v along axis K.
template <int K, class T>
T& component(Vec3<T>& v) {
  return K == 0 ? v.x : K == 1 ? v.y : v.z;
}

/// s x, x a rate or an acceleration.
template <int K, class T>
struct AlongAxis {
  T x;  ///< q̇ [rad/s] or q̈ [rad/s²]
};
/// ad_V s x = [ω×e_K; v×e_K] x: nothing along K. i, j follow K cyclically.
template <int K, class T>
struct AcrossAxis {
  /// Entries along the axes i = K + 1 and j = K + 2 (mod 3) of its angular and its linear half.
  ///@{
  T angular_i, angular_j, linear_i, linear_j;
  ///@}
};

/// s x.
template <int K, class T>
  requires Scalar<T>
AlongAxis<K, T> operator*(RevoluteAxis<K>, const T& x) {
  return {x};
}
/// V + s x: one entry of V changes.
template <int K, class A, class B>
Twist<Prod<A, B>> operator+(const Twist<A>& V, const AlongAxis<K, B>& sx) {
  Twist<Prod<A, B>> out{V.angular.template cast<Prod<A, B>>(),
                        V.linear.template cast<Prod<A, B>>()};
  component<K>(out.angular) = component<K>(V.angular) + sx.x;
  return out;
}
/// Bracket of a twist with the axis: two entries of each half.
template <int K, class T>
AcrossAxis<K, T> ad(const Twist<T>& V, RevoluteAxis<K>) {
  constexpr int i = (K + 1) % 3, j = (K + 2) % 3;
  return {component<j>(V.angular), -component<i>(V.angular), component<j>(V.linear),
          -component<i>(V.linear)};
}
/// (ad_V s) x, x a rate.
template <int K, class A, class B>
AcrossAxis<K, Prod<A, B>> operator*(const AcrossAxis<K, A>& U, const B& x) {
  return {U.angular_i * x, U.angular_j * x, U.linear_i * x, U.linear_j * x};
}
/// V + U: two entries of each half of V change.
template <int K, class T>
Twist<T> operator+(const Twist<T>& V, const AcrossAxis<K, T>& U) {
  constexpr int i = (K + 1) % 3, j = (K + 2) % 3;
  Twist<T> out = V;
  component<i>(out.angular) = component<i>(V.angular) + U.angular_i;
  component<j>(out.angular) = component<j>(V.angular) + U.angular_j;
  component<i>(out.linear) = component<i>(V.linear) + U.linear_i;
  component<j>(out.linear) = component<j>(V.linear) + U.linear_j;
  return out;
}
/// Power of a wrench along the axis: one entry.
template <int K, class T>
const T& dot(RevoluteAxis<K>, const Wrench<T>& W) {
  return component<K>(W.torque);
}

/// Ad_{X_AB} s: the axis seen from A.
template <int K, class T>
Twist<T> to_parent(const Pose<T>& X_AB, RevoluteAxis<K>) {
  return {X_AB.R.col[K], cross(X_AB.p, X_AB.R.col[K])};
}

/// Column K of S.
template <int K, class T>
Vec3<T> column(const Sym3<T>& s) {
  if constexpr (K == 0) return {s.xx, s.xy, s.xz};
  if constexpr (K == 1) return {s.xy, s.yy, s.yz};
  return {s.xz, s.yz, s.zz};
}
/// M̄ s.
template <int K, class T>
Wrench<T> operator*(const SpatialInertia<T>& M, RevoluteAxis<K>) {
  constexpr int i = (K + 1) % 3, j = (K + 2) % 3;
  Wrench<T> out{column<K>(M.I), {}};  // −h × e_K
  component<i>(out.force) = -component<j>(M.h);
  component<j>(out.force) = component<i>(M.h);
  component<K>(out.force) = T(0.0);
  return out;
}
/// M̂ s.
template <int K, class T>
Wrench<T> operator*(const ArticulatedInertia<T>& M, RevoluteAxis<K>) {
  return {column<K>(M.I),
          {component<K>(M.H.col[0]), component<K>(M.H.col[1]), component<K>(M.H.col[2])}};
}
/// M̂ U, U = ad_V s x.
template <int K, class T>
Wrench<T> operator*(const ArticulatedInertia<T>& M, const AcrossAxis<K, T>& U) {
  constexpr int i = (K + 1) % 3, j = (K + 2) % 3;
  const Mat3<T>& H = M.H;
  const auto Ht = [&](auto row) -> Vec3<T> {  // column of Hᵀ
    constexpr int k = decltype(row)::value;
    return {component<k>(H.col[0]), component<k>(H.col[1]), component<k>(H.col[2])};
  };
  return {column<i>(M.I) * U.angular_i + column<j>(M.I) * U.angular_j + H.col[i] * U.linear_i +
              H.col[j] * U.linear_j,
          Ht(std::integral_constant<int, i>{}) * U.angular_i +
              Ht(std::integral_constant<int, j>{}) * U.angular_j + column<i>(M.M) * U.linear_i +
              column<j>(M.M) * U.linear_j};
}

}  // namespace diffnea
