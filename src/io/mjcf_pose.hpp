#pragma once
/// Poses as MJCF says them: five ways to say an orientation, in degrees or not.

#include <string>

#include <diffnea/lie/se3.hpp>

#include "io/mjcf_defaults.hpp"
#include "io/xml.hpp"

namespace diffnea::io {

/// Units and conventions of a document.
struct MjcfAngles {
  bool degrees = true;
  std::string euler = "xyz";  ///< axes in their order; lower case: those that turn

  /// Reads the document's <compiler> elements.
  explicit MjcfAngles(XmlElement& root);
};

/// Pose of an element in what carries it: `pos` and one of `quat`, `axisangle`, `euler`, `xyaxes`,
/// `zaxis`, its own or of its class.
Pose<double> mjcf_pose(const XmlElement& element, const MjcfDefaults& defaults,
                       const MjcfAngles& angles);
/// States the pose in the element, in place of what it said.
void set_mjcf_pose(XmlElement& element, const Pose<double>& X);

/// Numbers of an attribute, as many as there are.
std::vector<double> mjcf_numbers(const std::string& text);
Vec3<double> mjcf_vec3(const std::string& text, const Vec3<double>& otherwise);

}  // namespace diffnea::io
