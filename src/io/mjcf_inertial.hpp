#pragma once
/// An inertia as an MJCF element.

#include <limits>

#include <diffnea/lie/inertia.hpp>

#include "io/xml.hpp"

namespace diffnea::io {

/// First child of a <body>, in principal axes: MuJoCo would diagonalise a full tensor itself, to
/// 1e-6 only. A body without inertia says so, or MuJoCo would weigh its geoms.
/// @param least  principal moments below it are raised to it [kg·m²]
void write_mjcf_inertial(XmlElement& body, const SpatialInertia<double>& inertia,
                         double least = -std::numeric_limits<double>::infinity());

}  // namespace diffnea::io
