#pragma once
/// Bodies in maximal coordinates: six numbers of motion each, whatever joins them.
///
/// V̇ = M̄⁻¹ (f̄_g + f̄_c + f̄_u + ad*_V M̄ V), the paper's "Rigid-Body Physics with Nonholonomic
/// Constraints". Twists and wrenches are the body's, in its frame B, angular first.

#include <vector>

#include <diffnea/lie/inertia.hpp>

namespace diffnea {

/// What a body in maximal coordinates can do.
enum class BodyKind {
  kRigid,
  kParticle,    ///< mass alone: it never turns, B keeps the world's axes
  kPrescribed,  ///< its motion is given: a driven pivot, a measured hand
};

/// A body in maximal coordinates: what moves it and what it weighs.
template <Scalar T>
struct FreeBody {
  BodyKind kind = BodyKind::kRigid;  ///< which parts of its inertia and twist are read
  SpatialInertia<T> inertia;         ///< about B's origin, in B; of a particle the mass alone
};
/// A body without extent. @param mass  [kg]
template <Scalar T>
FreeBody<T> particle(const T& mass) {
  FreeBody<T> out{BodyKind::kParticle, {}};
  out.inertia.m = mass;
  return out;
}

/// Where a body is and how it moves.
template <Scalar T>
struct BodyState {
  Pose<T> X_WB = Pose<T>::identity();  ///< pose of B in W
  Twist<T> V{};                        ///< twist of B against W, in B [rad/s, m/s]
};

/// M̄⁻¹ W: with p the centre of mass, ω̇ = I_c⁻¹(τ − p×f), v̇ = f/m + p×ω̇. Zero if prescribed.
template <Scalar T>
class Mobility {
 public:
  /// Inverts the inertia of `body`.
  explicit Mobility(const FreeBody<T>& body) : kind_(body.kind) {
    if (kind_ == BodyKind::kPrescribed) return;
    per_mass_ = T(1.0) / body.inertia.m;
    if (kind_ == BodyKind::kParticle) return;
    p_com_ = body.inertia.h * per_mass_;
    const Sym3<T> I = inertia_about_com(body.inertia);
    const T a = I.yy * I.zz - I.yz * I.yz, b = I.xz * I.yz - I.xy * I.zz,
            c = I.xy * I.yz - I.xz * I.yy, s = T(1.0) / (I.xx * a + I.xy * b + I.xz * c);
    per_inertia_ = {a * s,
                    b * s,
                    c * s,
                    (I.xx * I.zz - I.xz * I.xz) * s,
                    (I.xy * I.xz - I.xx * I.yz) * s,
                    (I.xx * I.yy - I.xy * I.xy) * s};
  }
  /// V̇ under the net wrench W, in B [rad/s², m/s²]; of an impulse [N·m·s, N·s] the change of V.
  Twist<T> operator*(const Wrench<T>& W) const {
    const Vec3<T> zero{T(0.0), T(0.0), T(0.0)};
    if (kind_ == BodyKind::kPrescribed) return {zero, zero};
    const Vec3<T> linear = W.force * per_mass_;
    if (kind_ == BodyKind::kParticle) return {zero, linear};
    const Vec3<T> angular = per_inertia_ * (W.torque - cross(p_com_, W.force));
    return {angular, linear + cross(p_com_, angular)};
  }

 private:
  BodyKind kind_;
  T per_mass_{};
  Vec3<T> p_com_{};
  Sym3<T> per_inertia_{};
};

/// Weight of a body, in B: f̄_g. @param gravity in W [m/s²]
template <Scalar T>
Wrench<T> weight(const FreeBody<T>& body, const Pose<T>& X_WB, const Vec3<T>& gravity) {
  const Vec3<T> g_B = transpose_times(X_WB.R, gravity);
  return {cross(body.inertia.h, g_B), g_B * body.inertia.m};
}

}  // namespace diffnea
