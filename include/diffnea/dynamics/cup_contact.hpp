#pragma once
/// What a ball meets on its way into a cup, where the model knows no contact: it is caught, or it
/// touched something and the model knows no further. Geometry alone.

#include <diffnea/core/scalar.hpp>
#include <diffnea/lie/vec3.hpp>
#include <diffnea/model/ball.hpp>

namespace diffnea {

/// A point against the cup: height along the axis and distance from it [m].
template <class T>
struct CupPosition {
  T height,    ///< along the axis, from the cup's origin [m]
      radius;  ///< distance from the axis [m]
};

/// @param p_C  the cup's origin, W  @param axis  of length 1, W
template <class T>
CupPosition<T> cup_position(const Vec3<T>& x, const Vec3<T>& p_C, const Vec3<T>& axis) {
  using std::sqrt;
  const Vec3<T> d = x - p_C;
  const T height = dot(d, axis), squared = dot(d, d) - height * height;
  return {height, sqrt(select(squared > T(0.0), squared, T(0.0)))};
}

/// Whether the ball's centre came through the rim's plane from above, where the ball passes the rim
/// without touching it.
template <class T>
auto is_caught(const CupPosition<T>& before, const CupPosition<T>& now, const CupSpec& cup,
               double ball_radius) {
  const T rim(cup.rim);
  const T share = (before.height - rim) /
                  select(before.height > now.height, T(before.height - now.height), T(1.0));
  const T radius = before.radius + (now.radius - before.radius) * share;
  return before.height > rim && now.height <= rim && radius <= T(cup.inner_radius - ball_radius);
}

/// Whether the ball's centre is where that of a ball in the cup is.
template <class T>
auto is_inside(const CupPosition<T>& p, const CupSpec& cup) {
  return p.height > T(cup.floor) && p.height < T(cup.rim) && p.radius < T(cup.inner_radius);
}

/// Distance of the ball's centre from the cup as a solid body, open above [m].
template <class T>
T distance_to_cup(const CupPosition<T>& p, const CupSpec& cup) {
  using std::sqrt;
  const auto positive = [](const T& a) { return select(a > T(0.0), a, T(0.0)); };
  const T over = positive(T(p.height - T(cup.rim)));
  const T under =
      positive(T(-p.height));  // the string is tied below the floor: solid down to there
  const T beside = positive(T(p.radius - T(cup.inner_radius + cup.wall)));
  const T within = positive(T(T(cup.inner_radius) - p.radius));
  // Over the opening the rim alone is there.
  const T sideways = select(over > T(0.0), T(beside + within), beside);
  return sqrt(over * over + under * under + sideways * sideways);
}

/// Distance of a point from a segment [m].
template <class T>
T distance_to_segment(const Vec3<T>& x, const Vec3<T>& a, const Vec3<T>& b) {
  using std::sqrt;
  const Vec3<T> ab = b - a, ax = x - a;
  const T squared = dot(ab, ab) + T(1e-12);  // a sphere's segment is a point
  T share = dot(ab, ax) / squared;
  share = select(share < T(0.0), T(0.0), select(share > T(1.0), T(1.0), share));
  const Vec3<T> d = ax - ab * share;
  return sqrt(dot(d, d));
}

}  // namespace diffnea
