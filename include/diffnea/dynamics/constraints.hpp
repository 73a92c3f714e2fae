#pragma once
/// Constraints between bodies A and B, or between B and the world (body index kWorld). Parameters
/// may be Jets: what a fit moves. Each is one function of poses, or of poses and twists.

#include <diffnea/dynamics/constraint.hpp>

namespace diffnea {

/// Point Q of B stays at distance `length` of point P of A: g = ‖Δ‖² − r² [m²].
template <class P>
struct Rod {
  static constexpr int kBodies = 2,                        ///< A, B
      kRows = 1;                                           ///< ‖Δ‖² − r²
  static constexpr Relation kRelation = Relation::kEqual;  ///< g = 0
  Vec3<P> p_AP,                                            ///< P in A [m]
      p_BQ;                                                ///< Q in B [m]
  P length{};                                              ///< r [m]

  /// g [m²] at X = {X_WA, X_WB}.
  template <class T>
  std::array<T, 1> operator()(const std::array<Pose<T>, 2>& X) const {
    const Vec3<T> delta =
        X[1].R * p_BQ.template cast<T>() + X[1].p - (X[0].R * p_AP.template cast<T>() + X[0].p);
    const T r(length);
    return {dot(delta, delta) - r * r};
  }
};

/// The same as an upper bound: a string that only pulls, h = ‖Δ‖² − r² ≤ 0 [m²].
template <class P>
struct String : Rod<P> {
  static constexpr Relation kRelation = Relation::kAtMost;  ///< g ≤ 0
};

/// Points P of A and Q of B coincide: a ball joint, or a pendulum's pivot.
template <class P>
struct BallJoint {
  static constexpr int kBodies = 2,                        ///< A, B
      kRows = 3;                                           ///< Δ of Q against P, in W
  static constexpr Relation kRelation = Relation::kEqual;  ///< g = 0
  Vec3<P> p_AP,                                            ///< P in A [m]
      p_BQ;                                                ///< Q in B [m]

  /// g [m] at X = {X_WA, X_WB}.
  template <class T>
  std::array<T, 3> operator()(const std::array<Pose<T>, 2>& X) const {
    const Vec3<T> delta =
        X[1].R * p_BQ.template cast<T>() + X[1].p - (X[0].R * p_AP.template cast<T>() + X[0].p);
    return {delta.x, delta.y, delta.z};
  }
};

/// A revolute joint: frames J of A and K of B share their origin and their z axis.
template <class P>
struct Hinge {
  static constexpr int kBodies = 2,  ///< A, B
      kRows = 5;  ///< Δ of K's origin against J's, in W, and J's x and y against K's z
  static constexpr Relation kRelation = Relation::kEqual;  ///< g = 0
  Pose<P> X_AJ,                                            ///< J in A
      X_BK;                                                ///< K in B

  /// g [m, m, m, 1, 1] at X = {X_WA, X_WB}.
  template <class T>
  std::array<T, 5> operator()(const std::array<Pose<T>, 2>& X) const {
    const Pose<T> X_WJ = X[0] * X_AJ.template cast<T>(), X_WK = X[1] * X_BK.template cast<T>();
    const Vec3<T> delta = X_WK.p - X_WJ.p;
    return {delta.x, delta.y, delta.z, dot(X_WJ.R.col[0], X_WK.R.col[2]),
            dot(X_WJ.R.col[1], X_WK.R.col[2])};
  }
};

/// Frames J of A and K of B coincide. The rows of the turn are those of sin(θ) a, θ a the turn of K
/// against J: zero at half a turn as well.
template <class P>
struct Weld {
  static constexpr int kBodies = 2,  ///< A, B
      kRows = 6;                     ///< Δ of K's origin against J's, in W, then the turn, in J
  static constexpr Relation kRelation = Relation::kEqual;  ///< g = 0
  Pose<P> X_AJ,                                            ///< J in A
      X_BK;                                                ///< K in B

  /// g [m, m, m, 1, 1, 1] at X = {X_WA, X_WB}.
  template <class T>
  std::array<T, 6> operator()(const std::array<Pose<T>, 2>& X) const {
    const Pose<T> X_WJ = X[0] * X_AJ.template cast<T>(), X_WK = X[1] * X_BK.template cast<T>();
    const Vec3<T> delta = X_WK.p - X_WJ.p;
    const auto turn = [&](std::size_t i, std::size_t j) {  // (R_ji − R_ij)/2 of R_JK
      return (dot(X_WJ.R.col[j], X_WK.R.col[i]) - dot(X_WJ.R.col[i], X_WK.R.col[j])) * T(0.5);
    };
    return {delta.x, delta.y, delta.z, turn(1, 2), turn(2, 0), turn(0, 1)};
  }
};

/// Lowest point of a thin wheel against its centre, in W: r (e_z − (a·e_z) a)/√(1 − (a·e_z)²) down,
/// a the axle. Undefined for a wheel that lies flat.
template <class T>
Vec3<T> lowest_of_wheel(const Vec3<T>& axle, const T& radius) {
  using std::sqrt;
  const T along = axle.z, across = sqrt(T(1.0) - along * along);
  const Vec3<T> up = Vec3<T>{T(0.0), T(0.0), T(1.0)} - axle * along;
  return up * (-radius / across);
}

/// A thin wheel touches the plane z = 0: the height of its lowest point [m].
template <class P>
struct WheelContact {
  static constexpr int kBodies = 1,  ///< the wheel, or what its axle is fixed to
      kRows = 1;                     ///< height of the lowest point
  static constexpr Relation kRelation = Relation::kEqual;  ///< g = 0
  Vec3<P> p_BC,                                            ///< its centre, in B [m]
      axle_B;                                              ///< unit vector along its axle, in B
  P radius{};                                              ///< [m]

  /// g [m] at X = {X_WB}.
  template <class T>
  std::array<T, 1> operator()(const std::array<Pose<T>, 1>& X) const {
    const Vec3<T> centre = X[0].R * p_BC.template cast<T>() + X[0].p;
    return {centre.z + lowest_of_wheel(X[0].R * axle_B.template cast<T>(), T(radius)).z};
  }
};

/// The material point of a wheel that touches the plane stands still along x and y [m/s]: rolling
/// without slip. Its height is WheelContact's.
template <class P>
struct RollingWheel {
  static constexpr int kBodies = 1,  ///< the wheel
      kRows = 2;                     ///< velocity of the touching point along x and y of W
  static constexpr Relation kRelation = Relation::kEqual;  ///< g = 0
  Vec3<P> p_BC,                                            ///< its centre, in B [m]
      axle_B;                                              ///< unit vector along its axle, in B
  P radius{};                                              ///< [m]

  /// g [m/s] at X = {X_WB} and V = {twist of B against W, in B}.
  template <class T>
  std::array<T, 2> operator()(const std::array<Pose<T>, 1>& X,
                              const std::array<Twist<T>, 1>& V) const {
    const Mat3<T>& R = X[0].R;
    const Vec3<T> contact = lowest_of_wheel(R * axle_B.template cast<T>(), T(radius));
    const Vec3<T> centre = V[0].linear + cross(V[0].angular, p_BC.template cast<T>());
    const Vec3<T> v = R * centre + cross(R * V[0].angular, contact);
    return {v.x, v.y};
  }
};

/// A blade at point P of B moves along its direction alone: the velocity across it, in the plane
/// z = 0 of W, is zero [m/s] (Chaplygin's sleigh, a skate, a knife edge).
template <class P>
struct Skate {
  static constexpr int kBodies = 1,                        ///< what the blade is fixed to
      kRows = 1;                                           ///< velocity across the blade
  static constexpr Relation kRelation = Relation::kEqual;  ///< g = 0
  Vec3<P> p_BP,                                            ///< where the blade touches, in B [m]
      across_B;  ///< unit vector across the blade, in B, horizontal

  /// g [m/s] at V = {twist of B against W, in B}.
  template <class T>
  std::array<T, 1> operator()(const std::array<Pose<T>, 1>&,
                              const std::array<Twist<T>, 1>& V) const {
    const Vec3<T> v = V[0].linear + cross(V[0].angular, p_BP.template cast<T>());
    return {dot(v, across_B.template cast<T>())};
  }
};

}  // namespace diffnea
