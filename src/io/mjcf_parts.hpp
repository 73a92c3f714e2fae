#pragma once
/// What reading, compiling and writing an MJCF share. Internal to io/.

#include <string>
#include <vector>

#include <diffnea/lie/inertia.hpp>
#include <diffnea/lie/se3.hpp>

#include "io/mjcf.hpp"
#include "io/xml.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::io {

inline Vec3<double> vec(const mjtNum* v) { return {v[0], v[1], v[2]}; }
inline Pose<double> shift(const Vec3<double>& p) { return {Mat3<double>::identity(), p}; }

/// Name of one of MuJoCo's objects, or what stands for it where the file gives none.
inline const char* object_name(const mjModel& m, mjtObj type, int id, const char* otherwise) {
  const char* name = mj_id2name(&m, type, id);
  return name ? name : otherwise;
}

/// About the body's origin, in the body.
SpatialInertia<double> body_inertia(const mjModel& m, int b);

/// Attributes by which elements outside of bodies name bodies, and elements on them.
inline constexpr const char* kReferences[] = {
    "joint",  "jointinparent", "joint1",  "joint2", "body",     "body1",     "body2",
    "geom",   "geom1",         "geom2",   "site",   "refsite",  "site1",     "site2",
    "tendon", "tendon1",       "tendon2", "target", "sidesite", "cranksite", "slidersite"};
/// Sections of such elements.
inline constexpr const char* kSectionsThatRefer[] = {"actuator", "contact", "equality", "tendon"};

/// Whether the compiler is told to take inertias from geometry, whatever the bodies state.
bool inertia_from_geoms(XmlElement& root);

/// What becomes of a geom whose mesh or height field is left out.
enum class LostShape {
  kMarked,  ///< a small box without mass: what it collides with is still known
  kGone     ///< and with it the contact pairs that name it
};

/// Removes what needs files and gives no moving body mass, so that a model compiles where its looks
/// are missing. Frames must have been resolved.
/// @param weigh_all  bodies that state their inertia are weighed by their meshes all the same
/// @param notes  gains the bodies that meshes weigh, and those that are not for want of a file
void strip_looks(XmlElement& root, const Mjcf& mjcf, bool weigh_all, LostShape lost,
                 std::vector<std::string>& notes);

}  // namespace diffnea::io
