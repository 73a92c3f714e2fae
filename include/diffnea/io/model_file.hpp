#pragma once
/// Robot descriptions: URDF, MJCF and the project's JSON (docs/models.md, docs/schema/model.md).
///
///     Model model = read_model("panda.urdf");
///     set_inertial_parameters(model, pi);                      // what identification found
///     for (const std::string& note : write_model(model, "panda_identified.urdf")) ...
///
/// What the formats' friction, spring and rotor terms become, per joint:
///
///     effect, parameters                 MJCF joint             URDF <dynamics>
///     viscous_friction  {viscous}        damping                damping
///     coulomb_friction  {coulomb}        frictionloss           friction
///     armature          {armature}       armature               –
///     joint_spring      {stiffness,rest} stiffness, springref   –

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea {

/// Permissions of a reader: which parts of a robot description that no model holds it may leave
/// out, and where the description's files may lie.
struct ModelReading {
  bool fix_base = false;       ///< a floating base is fixed where the file has it
  bool free_base = false;      ///< the root of a URDF or JSON floats, though the file has it fixed
  bool open_loops = false;     ///< equality constraints, mimic tags are left out, and noted
  bool allow_outside = false;  ///< files that an MJCF names need not lie in its folder or below
  /// Names and texts (core/options.hpp).
  template <class List>
  void options(List& list) {
    list.option("--fix-base", "fix_base", fix_base,
                "fix a floating base where the file has it, as if the robot hung there");
    list.option("--free-base", "free_base", free_base,
                "let the root of a URDF or JSON float, which most descriptions of legged robots "
                "leave to the user");
    list.option("--open-loops", "open_loops", open_loops,
                "leave out an MJCF's equality constraints and a URDF's mimic tags: coupled joints "
                "move alone, and the forces of the coupling are missing");
    list.option("--allow-outside", "allow_outside", allow_outside,
                "let an MJCF name files outside its folder");
  }
};

/// Reads a robot description. The content decides: `<robot>` is URDF, `<mujoco>` is MJCF, `{` the
/// project's JSON. Meshes of a URDF are never opened. A model whose inertias cannot be true is
/// read; check_model says what is wrong with it. (MuJoCo's compiler refuses such an MJCF, in its
/// words.) A floating joint at the root of a URDF, or a free body of an MJCF, is a free base. Files
/// that an MJCF includes must lie in its folder or below, unless `reading` says that they need not.
/// @throws FileError if a file cannot be read
/// @throws ModelError naming file and reason if it cannot be understood, or if it holds what a tree
/// of
///         revolute, prismatic and fixed joints on a fixed or a free base cannot: loops, floating
///         joints elsewhere, planar and ball joints, several free bodies (but the one named `ball`,
///         which is Model::ball), equality constraints; or if `reading` both fixes and frees the
///         base
Model read_model(const std::filesystem::path& path, const ModelReading& reading = {});

/// Reads a robot description, or of a folder that a run left its model.json: the model as fitted or
/// extended. `source` is then the model.urdf or model.xml beside it, so that write_model keeps that
/// document.
/// @throws FileError if a folder holds no model.json; else as read_model
Model read_model_or_run(const std::filesystem::path& path, const ModelReading& reading = {});

/// The form of the document that the model was read from, which write_model keeps: `.urdf`, `.xml`;
/// empty for JSON, or if it is not there any more.
/// @throws FileError, ModelError if it cannot be read, or is no robot description any more
std::string document_extension(const Model& model);

/// An MJCF as one document that needs no other file, for a simulator: includes resolved, textures
/// gone, and meshes too (the bodies whose inertia they gave state it).
/// @throws FileError, ModelError as read_model
std::string read_mjcf(const std::filesystem::path& path, const ModelReading& reading = {});

/// @throws ModelError if the extension names no format that write_model knows
void check_model_path(const std::filesystem::path& path);

/// Contents of a file that is written.
struct ModelWriting {
  /// Oldest MuJoCo that has to load an MJCF: "2.2" and later; delays of drives need "3.5".
  std::string mujoco = "2.2";
};

/// Writes a model. `.json` holds all of it. `.urdf` and `.xml` of a model that was read from that
/// format: its original document (model.source) is written with the changed values put in place:
/// inertias, friction, rotor inertia, spring, limits, in a URDF the joints' poses, in an MJCF the
/// ball's mass and string. The moving link takes the inertia of its lump, links fixed to it none.
/// An MJCF is compiled again and compared with what it is to say before anything is written.
/// Of any other model, and of one whose document cannot be read where it lies, a new document is
/// drawn, without looks: in a URDF frames become links, in an MJCF they become sites, and joints
/// that are not passive get a motor.
/// @param reading  of the original document; its base counts as what the model's is, loops as open
/// @return what the format cannot express, one phrase each, for the user
/// @throws FileError if the original cannot be read or the file not be written
/// @throws ModelError if the original has other links, positions in global coordinates, or
///         something that overrules what is put into it; if the extension names no format, a link
///         has an inertia without mass, or MuJoCo refuses the document (an inertia that no body
///         can have); if `writing` names no version of MuJoCo from 2.2 on
std::vector<std::string> write_model(const Model& model, const std::filesystem::path& path,
                                     const ModelReading& reading = {},
                                     const ModelWriting& writing = {});

/// The project's JSON, schema "diffnea/model/1". Doubles come back bit by bit.
/// @throws ModelError if a number is not finite where the schema has no word for it
std::string model_to_json(const Model& model);
/// @param where  what to call the text in messages, e.g. its path
/// @throws ModelError with place and reason; an unknown key is refused with the list of those known
Model model_from_json(std::string_view text, const std::string& where);

}  // namespace diffnea
