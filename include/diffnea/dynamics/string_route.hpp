#pragma once
/// The way that a string takes around the cup it is tied below: over the edge of the floor, up the
/// wall and over the rim, where the straight way to the ball is barred. Without friction and
/// without mass it is the shortest one. From the last edge on it is free, so that the ball moves as
/// on a shorter string that is tied there.
///
/// All of it lies in the half plane through the cup's axis and the ball: a string that is tied some
/// millimetres off the axis is longer by a few micrometres.

#include <diffnea/core/scalar.hpp>
#include <diffnea/dynamics/cup_contact.hpp>
#include <diffnea/dynamics/string_particle.hpp>
#include <diffnea/model/ball.hpp>

namespace diffnea {

/// A string as its ball feels it.
template <Scalar T>
struct FreeString {
  AnchorMotion<T> anchor;  ///< from where on it is free, W
  T length{};              ///< from there [m]
};

/// Where the string is last bent, and its length up to there [m].
template <class T>
struct StringRoute {
  CupPosition<T> edge;  ///< that bend; the knot if it is straight
  T used;               ///< length from the knot to `edge` [m]; 0: it is straight
};

/// @param size  of what is in the way, over the cup's: the cup shrunk towards the knot
template <class T>
StringRoute<T> route_around_cup(const CupPosition<T>& ball, const CupPosition<T>& knot,
                                const CupSpec& cup, const T& size) {
  using std::sqrt;
  constexpr double kLeast = 1e-6;  // of the cup: at size 0, derivatives still see where it would be
  const T s = size + T(kLeast);
  // From the knot: the floor's edge, the rim's height, the ball.
  const T out = s * (T(cup.inner_radius + cup.wall) - knot.radius),
          up = s * (T(cup.floor - cup.wall) - knot.height), rim = s * (T(cup.rim) - knot.height),
          away = ball.radius - knot.radius, above = ball.height - knot.height;
  const T to_floor = sqrt(out * out + up * up), zero(0.0);
  const auto barred = above * out > up * away;
  const auto over = barred && away < out && above > rim;
  return {{knot.height + select(over, rim, select(barred, up, zero)),
           knot.radius + select(barred, out, zero)},
          select(barred, T(to_floor + select(over, T(rim - up), zero)), zero)};
}

}  // namespace diffnea
