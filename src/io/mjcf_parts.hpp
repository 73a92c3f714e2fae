#pragma once
/// What reading, compiling and writing an MJCF share. Internal to io/.

#include <diffnea/lie/inertia.hpp>
#include <diffnea/lie/se3.hpp>

#include "io/xml.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::io {

inline Vec3<double> vec(const mjtNum* v) { return {v[0], v[1], v[2]}; }
inline Pose<double> shift(const Vec3<double>& p) { return {Mat3<double>::identity(), p}; }

/// About the body's origin, in the body.
SpatialInertia<double> body_inertia(const mjModel& m, int b);

/// Whether the compiler is told to take inertias from geometry, whatever the bodies state.
bool inertia_from_geoms(XmlElement& root);

/// What becomes of a geom whose mesh or height field is left out.
enum class LostShape {
  kMarked,  ///< a small box without mass: what it collides with is still known
  kGone     ///< and with it the contact pairs that name it
};

/// Removes what needs files and has no mass, so that a model compiles where its looks are missing.
/// @param weigh_all  bodies that state their inertia are weighed by their meshes all the same
void strip_looks(XmlElement& root, bool weigh_all, LostShape lost);

}  // namespace diffnea::io
