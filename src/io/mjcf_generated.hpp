#pragma once
/// Bodies that an MJCF of today does not draw where they are: <replicate> and <frame> become the
/// elements that they stand for, in the body around them.

#include <string>

#include "io/xml.hpp"

namespace diffnea::io {

/// @param where  of messages
/// @throws ModelError `where: line …` for what cannot be said without them
void expand_generated(XmlElement& root, const std::string& where);

}  // namespace diffnea::io
