#pragma once
/// Meshes of an MJCF that give a body its inertia, before MuJoCo's compiler sees them: it reads
/// wherever the indices of a face point, and ends the process at a file without content.

#include <filesystem>
#include <string>

#include "io/xml.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::io {

/// Checks the meshes below `root`, loads those that are files, and gives these flat names in
/// memory.
/// @param folder  of the model; files lie there or below
/// @throws ModelError `where: mesh '…': …` for a file that is outside, not to be read, empty or
/// larger than a file may be; fewer than four vertices; faces of vertices that there are not
void add_meshes(XmlElement& root, const std::filesystem::path& folder, const std::string& where,
                sim::MujocoFiles& files);

}  // namespace diffnea::io
