#pragma once
/// MJCF: translated into words of MuJoCo 2.2, compiled by it, written by editing the original
/// document. Nothing outside the folder of the model is opened unless asked: includes are resolved
/// here, and MuJoCo gets every file it may see from memory.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <diffnea/io/model_file.hpp>
#include <diffnea/model/model.hpp>

#include "io/xml.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::io {

using sim::MujocoModel;

/// One document in place of a file and all it includes, in the words of whoever wrote it.
struct Mjcf {
  std::unique_ptr<XmlDocument> document;
  std::filesystem::path folder;  ///< where the files it names must lie
  std::string where;             ///< for messages
  ModelReading reading;
  std::vector<std::string> files;  ///< names of those that were read; 0 is the model

  /// `line 12`, or `line 12 of arm.xml` in a file that is included.
  std::string line(XmlPlace place) const;
  std::string line(const XmlElement& element) const { return line(place_of(element)); }
  /// ` (line 12)` of the element with that tag and name; nothing if there is none.
  std::string line_of(const char* tag, const std::string& name) const;
};
/// @param text  the file's content  @throws ModelError, FileError
Mjcf expand_mjcf(const std::string& text, const std::filesystem::path& folder,
                 const std::string& where, const ModelReading& reading = {});

/// MuJoCo's compiler on the translation of a document. Textures, height fields, skins and the
/// meshes of bodies that state their inertia are left out: they do not move the robot.
/// @param notes  gains what else is left out; nullptr: nobody asks
/// @throws ModelError with MuJoCo's words, and the line of the user's file
MujocoModel compile_mjcf(const Mjcf& mjcf, std::vector<std::string>* notes = nullptr);

/// The document as text that needs no other file: meshes are gone, the bodies they gave an inertia
/// state it.
std::string self_contained_mjcf(const Mjcf& mjcf);

/// Name of a body or joint; `body3`, `joint2` where the file gives none (the number is MuJoCo's).
std::string body_name(const mjModel& m, int body);
std::string joint_name(const mjModel& m, int joint);

/// @param mjcf  what it was compiled from  @throws ModelError
Model model_from_mujoco(const mjModel& m, const Mjcf& mjcf);
Model model_from_mjcf(const std::string& text, const std::filesystem::path& folder,
                      const std::string& where, const ModelReading& reading);

/// The original document, includes resolved, with the values of `model` in place.
/// @param delays  of drives are written, for MuJoCo 3.5
/// @param notes   what an MJCF cannot express  @throws ModelError if the document has other bodies
std::string mjcf_with_values(const Mjcf& mjcf, const Model& model, bool delays,
                             std::vector<std::string>& notes);

}  // namespace diffnea::io
