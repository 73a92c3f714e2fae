#pragma once
/// MJCF: compiled by MuJoCo, written by editing the original document. Nothing outside the folder
/// of the model is opened: includes are resolved here, and MuJoCo gets every file it may see from
/// memory.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

#include "io/xml.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::io {

using sim::MujocoModel;

/// One document in place of a file and all it includes.
struct Mjcf {
  std::unique_ptr<XmlDocument> document;
  std::filesystem::path folder;  ///< where the files it names must lie
  std::string where;             ///< for messages
};
/// @param text  the file's content  @throws ModelError, FileError
Mjcf expand_mjcf(const std::string& text, const std::filesystem::path& folder,
                 const std::string& where);

/// MuJoCo's compiler on an expanded document. Textures, height fields, skins and the meshes of
/// bodies that state their inertia are left out: they do not move the robot.
/// @throws ModelError with MuJoCo's words
MujocoModel compile_mjcf(const Mjcf& mjcf);

/// The document as text that needs no other file: meshes are gone, the bodies they gave an inertia
/// state it.
std::string self_contained_mjcf(const Mjcf& mjcf);

/// Name of a body or joint; `body3`, `joint2` where the file gives none (the number is MuJoCo's).
std::string body_name(const mjModel& m, int body);
std::string joint_name(const mjModel& m, int joint);

/// @throws ModelError
Model model_from_mujoco(const mjModel& m, const std::string& where);
Model model_from_mjcf(const std::string& text, const std::filesystem::path& folder,
                      const std::string& where);

/// The original document, includes resolved, with the values of `model` in place.
/// @param notes  what an MJCF cannot express  @throws ModelError if the document has other bodies
std::string mjcf_with_values(const std::string& original, const std::filesystem::path& folder,
                             const std::string& where, const Model& model,
                             std::vector<std::string>& notes);

}  // namespace diffnea::io
