#pragma once
/// Values as URDF elements, for documents that are edited and for those that are drawn.

#include <diffnea/model/model.hpp>

#include "io/xml.hpp"

namespace diffnea::io {

/// Shortest decimal that reads back as the same double.
void set_number(XmlElement& element, const char* name, double value);
/// `xyz` [m] and `rpy` [rad] of an <origin>.
void set_xyz_rpy(XmlElement& origin, const Pose<double>& X);
/// The <inertial> of a <link>; none if the inertia is zero.
void write_urdf_inertial(XmlElement& link, const SpatialInertia<double>& inertia);

}  // namespace diffnea::io
