#pragma once
/// Equality constraints of an MJCF that close loops, connect and weld, both between bodies and
/// between sites.

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <mujoco/mujoco.h>

#include <diffnea/model/constraint_spec.hpp>

#include "io/xml.hpp"

namespace diffnea::io {

/// Link of a body of MuJoCo's, −1 for the world, and the body's pose in it.
using PlaceOfBody = std::function<std::pair<int, Pose<double>>(int body)>;

/// Connect and weld constraints that are active, as the file orders them.
/// @param left_out  bodies that are no links: what holds these does not matter
std::vector<ConstraintSpec> loop_constraints(const mjModel& m, const std::vector<bool>& left_out,
                                             const PlaceOfBody& place);

/// Name of constraint `e`, or one that no other has where the file gives none.
std::string constraint_name(const mjModel& m, int e);

/// Writes down the site that a constraint ends at, before bodies take its place: MuJoCo 2.2 knows
/// bodies alone. `loop_constraints` finds it again, in the document or in what is written from it.
/// @param end  "site1" or "site2"
void remember_site(XmlElement& constraint, const char* end, const std::string& site);

/// Adds the constraint to a document in which bodies have the links' names and frames.
/// @param bodies  elements, per link
/// @param q0_apart  whether its ends are apart at q = 0: then it is written between sites
/// @return whether MJCF can say it
bool write_constraint(XmlElement& root, const ConstraintSpec& constraint,
                      const std::vector<XmlElement*>& bodies, bool q0_apart);

}  // namespace diffnea::io
