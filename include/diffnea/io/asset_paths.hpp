#pragma once
/// Meshes and textures that a document names, seen from another folder.

#include <filesystem>
#include <string>

namespace diffnea {

/// An MJCF or URDF of the folder `from` as it has to be in `to`: paths that are relative lead to
/// the same files. Of a URDF those that are there; `package://` and the like stay.
/// @param text   the document
/// @param where  for messages
std::string with_moved_paths(const std::string& text, const std::string& where,
                             const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace diffnea
