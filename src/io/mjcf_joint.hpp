#pragma once
/// The range of a joint as an MJCF says it.

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

#include "io/xml.hpp"

namespace diffnea::io {

/// What of the range an MJCF can say: two finite ends, the lower below the upper; else none. The
/// limits of velocity and effort are as they were.
JointLimits mjcf_range(const JointLimits& limits);

/// `limited` and `range` of a <joint>, which says it has none where the link has.
/// @param unit  of the document's numbers [1/rad or 1/m]: 180/π for degrees
/// @param notes  gains the range that an MJCF cannot say
void write_mjcf_range(XmlElement& joint, const ModelLink& link, double unit,
                      std::vector<std::string>& notes);

}  // namespace diffnea::io
