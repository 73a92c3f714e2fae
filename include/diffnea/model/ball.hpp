#pragma once
/// A ball beside the robot: in free flight, or on a string that is tied to a link. Plain data.

#include <optional>

#include <diffnea/lie/vec3.hpp>

namespace diffnea {

/// A string without mass from the anchor S, fixed to a link, to the ball's centre.
struct StringSpec {
  int link = -1;               ///< index into Model::links, −1: S is fixed to the world
  Vec3<double> p_LS{0, 0, 0};  ///< the anchor, in that link's frame [m] (the paper's p_E)
  double length = 0.0;         ///< r, from S to the ball's centre [m]
  double length_std = 0.0;     ///< its standard error [m]; 0: it was not identified
};

/// A ball of a model: alone, or on a string.
struct BallSpec {
  double mass = 0.0;                 ///< [kg]
  double radius = 0.0;               ///< [m]; 0: not known
  std::optional<StringSpec> string;  ///< what it hangs on; none: it flies freely
};

/// A cup: a round wall, open at the end of its axis, that catches the ball. The frame `cup` of the
/// model is its frame: z is the axis, all heights are along it.
struct CupSpec {
  double inner_radius = 0.0;  ///< [m]
  double wall = 0.0;          ///< thickness [m]
  double floor = 0.0;         ///< height of the floor's upper side [m]
  double rim = 0.0;           ///< height [m]
};

/// A solid that the ball must not touch: all points within `radius` of a segment.
struct CapsuleSpec {
  int link = -1;               ///< index into Model::links, −1: fixed to the world
  Vec3<double> p_LA{0, 0, 0},  ///< one end of the segment, in that link's frame [m]
      p_LB{0, 0, 0};           ///< its other end, in that frame [m]; the same point: a sphere
  double radius = 0.0;         ///< [m]
};

}  // namespace diffnea
