#include "io/urdf_elements.hpp"

#include "io/model_parts.hpp"

namespace diffnea::io {

void set_number(XmlElement& element, const char* name, double value) {
  element.SetAttribute(name, exact(value).c_str());
}

void set_xyz_rpy(XmlElement& origin, const Pose<double>& X) {
  origin.SetAttribute("xyz", exact(X.p).c_str());
  origin.SetAttribute("rpy", exact(rpy_from_rotation(X.R)).c_str());
}

void write_urdf_inertial(XmlElement& link, const SpatialInertia<double>& b) {
  if (is_zero(b)) return remove_children(link, "inertial");
  XmlElement& inertial = child(link, "inertial");
  const ComInertia c = com_inertia(b);
  set_xyz_rpy(child(inertial, "origin"), {Mat3<double>::identity(), c.com});
  set_number(child(inertial, "mass"), "value", b.m);
  XmlElement& I = child(inertial, "inertia");
  set_number(I, "ixx", c.I.xx);
  set_number(I, "ixy", c.I.xy);
  set_number(I, "ixz", c.I.xz);
  set_number(I, "iyy", c.I.yy);
  set_number(I, "iyz", c.I.yz);
  set_number(I, "izz", c.I.zz);
}

}  // namespace diffnea::io
