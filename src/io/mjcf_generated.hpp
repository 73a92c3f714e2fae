#pragma once
/// Bodies that an MJCF of today does not draw where they are: <replicate> and <frame> become the
/// elements that they stand for, in the body around them.

#include "io/mjcf.hpp"
#include "io/xml.hpp"

namespace diffnea::io {

/// @param root  of a copy of the document, with its places
/// @throws ModelError `where: line …` for what cannot be said without them, or is too much
void expand_generated(XmlElement& root, const Mjcf& mjcf);

}  // namespace diffnea::io
