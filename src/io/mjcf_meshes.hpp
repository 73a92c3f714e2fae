#pragma once
/// Meshes of an MJCF that give a body its inertia, before MuJoCo's compiler sees them: it reads
/// wherever the indices of a face point, and ends the process at a file without content.

#include <filesystem>
#include <string>

#include "io/mjcf.hpp"
#include "io/xml.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::io {

/// Folder of the meshes, as the document's <compiler> says it; in the model's folder if relative.
std::filesystem::path mesh_folder(XmlElement& root);
/// Name of a mesh: its own, or its file's without folder and ending.
std::string mesh_name(const XmlElement& mesh);

/// Checks the meshes below `root`, the translation of `mjcf`, loads those that are files, and gives
/// these flat names in memory.
/// @throws ModelError `where: mesh '…': …` for a file that is outside, not to be read, empty or
/// larger than a file may be; fewer than four vertices; faces of vertices that there are not
void add_meshes(XmlElement& root, const Mjcf& mjcf, sim::MujocoFiles& files);

}  // namespace diffnea::io
