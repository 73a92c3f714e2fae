#pragma once
/// SE(3) and its (co)adjoints, angular first as corrected: V = [ω; v], W = [τ; f].
/// A pose X_AB maps points of B to A; inner letters meet: X_WL = X_WP * X_PL.

#include <diffnea/lie/so3.hpp>

namespace diffnea {

/// Twist or spatial acceleration, [rad/s, m/s] or [rad/s², m/s²].
template <class T>
struct Twist {
  Vec3<T> angular;  ///< ω [rad/s], or ω̇ [rad/s²]
  Vec3<T> linear;   ///< v of the body's point at the origin of the frame that the twist is in
                    ///< [m/s], or v̇ [m/s²]: not ẍ of that point, which is v̇ + ω×v
};

/// Wrench, [N·m, N].
template <class T>
struct Wrench {
  Vec3<T> torque;  ///< τ about the origin of the frame that the wrench is in [N·m]
  Vec3<T> force;   ///< f [N]
};

/// Entry by entry; what is added has to be in the same frame.
///@{
template <class A, class B>
Twist<Prod<A, B>> operator+(const Twist<A>& a, const Twist<B>& b) {
  return {a.angular + b.angular, a.linear + b.linear};
}
template <class A, class B>
  requires Scalar<B>
Twist<Prod<A, B>> operator*(const Twist<A>& a, const B& s) {
  return {a.angular * s, a.linear * s};
}
template <class A, class B>
Wrench<Prod<A, B>> operator+(const Wrench<A>& a, const Wrench<B>& b) {
  return {a.torque + b.torque, a.force + b.force};
}
template <class A, class B>
Wrench<Prod<A, B>> operator-(const Wrench<A>& a, const Wrench<B>& b) {
  return {a.torque - b.torque, a.force - b.force};
}
template <class A, class B>
  requires Scalar<B>
Wrench<Prod<A, B>> operator*(const Wrench<A>& a, const B& s) {
  return {a.torque * s, a.force * s};
}
///@}
/// Power Vᵀ W [W].
template <class A, class B>
Prod<A, B> dot(const Twist<A>& V, const Wrench<B>& W) {
  return dot(V.angular, W.torque) + dot(V.linear, W.force);
}

/// X_AB: rotation R_AB and position p_AB of B's origin in A [m].
template <class T>
struct Pose {
  Mat3<T> R;  ///< R_AB: its columns are the axes of B, in A
  Vec3<T> p;  ///< p_AB: the origin of B, in A [m]

  /// The frame itself.
  static Pose identity() { return {Mat3<T>::identity(), {T(0), T(0), T(0)}}; }
  /// A frame with the same axes, and its origin at p [m].
  static Pose translation(const Vec3<T>& p) { return {Mat3<T>::identity(), p}; }
  /// The same in another scalar.
  template <class U>
  Pose<U> cast() const {
    return {R.template cast<U>(), p.template cast<U>()};
  }
};

/// X_AC = X_AB X_BC.
template <class A, class B>
Pose<Prod<A, B>> operator*(const Pose<A>& X_AB, const Pose<B>& X_BC) {
  return {X_AB.R * X_BC.R, X_AB.R * X_BC.p + X_AB.p};
}
/// X_BA of X_AB.
template <class T>
Pose<T> inverse(const Pose<T>& X) {
  return {transpose(X.R), -transpose_times(X.R, X.p)};
}

/// Ad_{X_BA} V_A: the twist of A's frame, expressed in B. @param X_AB pose of B in A.
template <class A, class B>
Twist<Prod<A, B>> to_child(const Pose<A>& X_AB, const Twist<B>& V_A) {
  return {transpose_times(X_AB.R, V_A.angular),
          transpose_times(X_AB.R, V_A.linear + cross(V_A.angular, X_AB.p))};
}
/// Ad_{X_AB} V_B: the inverse of to_child.
template <class A, class B>
Twist<Prod<A, B>> to_parent(const Pose<A>& X_AB, const Twist<B>& V_B) {
  const Vec3<Prod<A, B>> w = X_AB.R * V_B.angular;
  return {w, X_AB.R * V_B.linear + cross(X_AB.p, w)};
}
/// Ad*_{X_BA} W_B = Ad_{X_BA}ᵀ W_B: the wrench on B, expressed in A (paper's f̄_j = Adᵀ f̄_i with
/// its indices corrected: i and j exchanged).
template <class A, class B>
Wrench<Prod<A, B>> to_parent(const Pose<A>& X_AB, const Wrench<B>& W_B) {
  const Vec3<Prod<A, B>> f = X_AB.R * W_B.force;
  return {X_AB.R * W_B.torque + cross(X_AB.p, f), f};
}

/// ad_V U, the Lie bracket: [ω×u_ω; v×u_ω + ω×u_v].
template <class A, class B>
Twist<Prod<A, B>> ad(const Twist<A>& V, const Twist<B>& U) {
  return {cross(V.angular, U.angular), cross(V.linear, U.angular) + cross(V.angular, U.linear)};
}
/// −ad*_V W = −ad_Vᵀ W: [ω×τ + v×f; ω×f]. The paper prints ad where ad* = adᵀ is right.
template <class A, class B>
Wrench<Prod<A, B>> minus_ad_star(const Twist<A>& V, const Wrench<B>& W) {
  return {cross(V.angular, W.torque) + cross(V.linear, W.force), cross(V.angular, W.force)};
}

/// exp(V), V = [ω; v]: the pose, against its old frame, of a body after one second at the twist V
/// in its own frame; X exp(V t) moves X at V. R = exp(ω), p = v + b ω×v + c ω×(ω×v) with b = (1 −
/// cos θ)/θ², c = (θ − sin θ)/θ³, θ = |ω| (Murray, Li, Sastry 1994, eq. 2.36). Any scalar but
/// packs.
template <class T>
Pose<T> exp(const Twist<T>& V) {
  const Vec3<T>&w = V.angular, &v = V.linear;
  const T s = dot(w, w);
  const Vec3<T> first = cross(w, v);
  return {exp(w),
          v + first * versine_over_square(s) + cross(w, first) * angle_minus_sine_over_cube(s)};
}

/// log X: the V with exp(V) = X and |ω| ≤ π; v = p − ½ ω×p + d ω×(ω×p) with
/// d = (1 − ½ θ cot(θ/2))/θ² (Murray, Li, Sastry 1994, inverse of eq. 2.36). As log of a
/// rotation at |ω| = π.
/// @param X  double or Jet
template <class T>
Twist<T> log(const Pose<T>& X) {
  const Vec3<T> w = log(X.R), first = cross(w, X.p);
  return {w, X.p - first * T(0.5) + cross(w, first) * cotangent_defect(T(dot(w, w)))};
}

}  // namespace diffnea
