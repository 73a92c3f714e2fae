#pragma once
/// What an MJCF may not ask of MuJoCo's compiler, which answers with hours, gigabytes or the end of
/// the process where it cannot give it.

#include <string>

#include "io/xml.hpp"

namespace diffnea::io {

/// Elements that a document may have: MuJoCo 2.2.2 compiles so many in seconds; its time grows with
/// their square.
inline constexpr long kMaxMjcfElements = 5000;

/// @param root  of a document whose includes are resolved
/// @throws ModelError `where: …` if it has too many elements or bodies (generated ones counted),
/// sizes that no robot needs, or numbers that are NaN
void check_mjcf(XmlElement& root, const std::string& where);

}  // namespace diffnea::io
