#include "io/mjcf_joint.hpp"

#include <cmath>

#include "io/model_parts.hpp"

namespace diffnea::io {

JointLimits mjcf_range(const JointLimits& limits) {
  JointLimits out = limits;
  if (std::isfinite(limits.lower) && std::isfinite(limits.upper) && limits.lower < limits.upper)
    return out;
  const JointLimits none;
  out.lower = none.lower;
  out.upper = none.upper;
  return out;
}

void write_mjcf_range(XmlElement& joint, const ModelLink& link, double unit,
                      std::vector<std::string>& notes) {
  const JointLimits range = mjcf_range(link.limits);
  if (std::isfinite(range.lower)) {
    joint.SetAttribute("limited", "true");
    joint.SetAttribute("range",
                       (exact(range.lower * unit) + " " + exact(range.upper * unit)).c_str());
    return;
  }
  joint.SetAttribute("limited", "false");
  const bool below = std::isfinite(link.limits.lower), above = std::isfinite(link.limits.upper);
  if (below && above)
    notes.push_back("the limits of '" + link.joint + "', between which there is no way (" +
                    exact(link.limits.lower) + " to " + exact(link.limits.upper) + ")");
  else if (below || above)
    notes.push_back("the limit of '" + link.joint + "' to one side");
}

}  // namespace diffnea::io
