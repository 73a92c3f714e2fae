#pragma once
/// URDFs as programs write them: what urdfdom refuses, and other readers take.

#include <string>
#include <vector>

#include "io/xml.hpp"

namespace diffnea::io {

/// Mends what has one meaning only, each with a note of element and value:
///  - numbers with a comma or full stop behind them; zeros beyond the three of a vector
///  - <limit> without effort or velocity: not known
///  - <inertial> without <inertia>: a point mass; without <mass>: left out
///  - a robot without a name: that of the file
/// @param robot  root element, edited
void repair_urdf(XmlElement& robot, const std::string& where, std::vector<std::string>& notes);

}  // namespace diffnea::io
