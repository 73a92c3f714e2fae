#pragma once
/// An MJCF of today in words that MuJoCo 2.2 reads: what it draws elsewhere is put where it is,
/// what it says in later words is mapped, left out or refused (mjcf_versions.hpp).

#include <string>
#include <vector>

#include "io/mjcf.hpp"
#include "io/mjcf_parts.hpp"

namespace diffnea::io {

/// True for a joint that `fix_base` takes out: a free one, but not that of a ball.
bool is_free_base(const XmlElement& joint);

/// @param root  of a copy of the document, with its places; becomes the translation
/// @param lost  what becomes of shapes that need files
/// @param notes  gains what is left out
/// @throws ModelError `where: line …` naming what a tree cannot hold, and what to do
void translate_mjcf(XmlElement& root, const Mjcf& mjcf, LostShape lost,
                    std::vector<std::string>& notes);

}  // namespace diffnea::io
