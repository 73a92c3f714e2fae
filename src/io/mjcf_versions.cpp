#include "io/mjcf_versions.hpp"

#include <algorithm>
#include <cstring>
#include <initializer_list>
#include <iterator>
#include <sstream>
#include <vector>

#include <mujoco/mujoco.h>

#include "io/mjcf_defaults.hpp"
#include "io/mjcf_loops.hpp"

namespace diffnea::io {
namespace {

using enum LaterMeans;

bool is_one_of(const std::string& value, std::initializer_list<const char*> words) {
  return std::ranges::any_of(words, [&](const char* word) { return value == word; });
}

// --- values that MuJoCo 2.2 has ------------------------------------------------------------------

bool old_integrator(const std::string& v) { return is_one_of(v, {"Euler", "RK4", "implicit"}); }
bool old_dynamics(const std::string& v) {
  return is_one_of(v, {"none", "integrator", "filter", "muscle", "user"});
}
bool old_gain(const std::string& v) { return is_one_of(v, {"fixed", "affine", "muscle", "user"}); }
bool old_bias(const std::string& v) { return is_one_of(v, {"none", "affine", "muscle", "user"}); }
bool old_site(const std::string& v) {
  return is_one_of(v, {"sphere", "capsule", "ellipsoid", "cylinder", "box"});
}
bool old_geom(const std::string& v) { return v != "sdf"; }
bool old_composite(const std::string& v) { return v != "cable"; }

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), {}};
}
bool is_zero_word(const std::string& word) {
  return word.find_first_not_of("+-0.") == std::string::npos;
}
bool is_one_number(const std::string& value) { return words_of(value).size() <= 1; }
bool is_not_zero(const std::string& value) {
  return !std::ranges::all_of(words_of(value), is_zero_word);
}
/// More than one coefficient, of which those of higher powers are zero: what can be cut.
bool is_polynomial(const std::string& value) {
  const std::vector<std::string> words = words_of(value);
  return words.size() <= 1 || !std::ranges::all_of(words.begin() + 1, words.end(), is_zero_word);
}

// --- words of MuJoCo 2.2 for them ----------------------------------------------------------------

void keep_first_number(XmlElement& e, const char* name) {
  const std::vector<std::string> words = words_of(attribute(e, name));
  if (!words.empty()) e.SetAttribute(name, words.front().c_str());
}

void take_out(XmlElement& e, const char* name) { e.DeleteAttribute(name); }

void rename_asset_folder(XmlElement& compiler, const char* name) {
  for (const char* folder : {"meshdir", "texturedir"})
    if (!compiler.Attribute(folder)) compiler.SetAttribute(folder, compiler.Attribute(name));
  compiler.DeleteAttribute(name);
}

void force_range(XmlElement& joint, const char* name) {
  if (attribute(joint, "actuatorfrclimited") != "false" &&
      attribute(joint, "actuatorforcelimited") != "false")
    joint.SetAttribute(kForceRange, attribute(joint, name).c_str());
  joint.DeleteAttribute(name);
}
void force_limited(XmlElement& joint, const char* name) {
  if (attribute(joint, name) == "false") joint.SetAttribute(kForceRange, "0 0");
  joint.DeleteAttribute(name);
}

void drive_damping(XmlElement& drive, const char* name) {
  drive.SetAttribute(kDriveBrakes, (attribute(drive, name) + " 0").c_str());
  drive.DeleteAttribute(name);
}
void drive_damping_ratio(XmlElement& drive, const char* name) {
  drive.SetAttribute(kDriveBrakes, ("0 " + attribute(drive, name)).c_str());
  drive.DeleteAttribute(name);
}

/// An actuator of a later kind as one that pulls at the same place with the same range of force.
void as_general(XmlElement& actuator, const char*) {
  actuator.SetName("general");
  actuator.DeleteChildren();
  std::vector<std::string> gone;
  for (const tinyxml2::XMLAttribute* a = actuator.FirstAttribute(); a; a = a->Next())
    if (!is_one_of(a->Name(), {"name", "class", "joint", "jointinparent", "tendon", "site",
                               "refsite", "body", "cranksite", "slidersite", "cranklength", "gear",
                               "forcerange", "forcelimited"}))
      gone.emplace_back(a->Name());
  for (const std::string& name : gone) actuator.DeleteAttribute(name.c_str());
}

/// Bodies in place of the sites on them, which are remembered; the anchor is the first site.
void sites_to_bodies(XmlElement& constraint, const char* name) {
  XmlElement* root = constraint.GetDocument()->RootElement();
  const bool first = std::strcmp(name, "site1") == 0;
  const std::string named = attribute(constraint, name);
  XmlElement* site = nullptr;
  for_each_child(*root, "worldbody", [&](XmlElement& world) {
    if (!site) site = find_named(world, "site", named);
  });
  const XmlElement* carrier = site ? site->Parent()->ToElement() : nullptr;
  constraint.SetAttribute(first ? "body1" : "body2", carrier && is(*carrier, "body")
                                                         ? attribute(*carrier, "name").c_str()
                                                         : "world");
  constraint.DeleteAttribute(name);
  if (site) remember_site(constraint, name, named);
  if (!is(constraint, "connect") || !(first || !constraint.Attribute("anchor"))) return;
  const std::string at = first && site ? MjcfDefaults(*root).attribute(*site, "pos") : "";
  constraint.SetAttribute("anchor", at.empty() ? "0 0 0" : at.c_str());
}

/// The compiler of MuJoCo 2.2 has one rule for all meshes.
void mesh_rule(XmlElement& mesh, const char* name) {
#if mjVERSION_HEADER < 320
  if (attribute(mesh, name) == "exact")
    child(*mesh.GetDocument()->RootElement(), "compiler").SetAttribute("exactmeshinertia", "true");
  mesh.DeleteAttribute(name);
#else
  static_cast<void>(mesh), static_cast<void>(name);
#endif
}

// --- the table -----------------------------------------------------------------------------------

constexpr const char* kSimulation = "settings of a simulation";
constexpr const char* kDrives = "settings of simulated drives";
constexpr const char* kContacts = "settings of contacts";
constexpr const char* kLooks = "looks";
constexpr const char* kDeformable = "deformable bodies, with their mass,";
constexpr const char* kPlugins = "plugins and their forces";
constexpr const char* kTendons = "inertia, yield and limits of tendons";
constexpr const char* kFiles = "settings of reading and writing files";
constexpr const char* kWeightless =
    "forces that carry weight in a simulation (gravity acts in full)";
constexpr const char* kAllDrives =
    "general motor position velocity intvelocity damper cylinder muscle";
constexpr const char* kPolynomial =
    "a joint here has one number, torque by angle or speed: keep the first, and let `--effects` "
    "find the rest";
constexpr const char* kCables = "bodies of such composites are not generated: draw them out";

constexpr LaterWord kWords[] = {
    // Bodies that are generated, or stand in another frame: before all else.
    {"frame", nullptr, "3.1", kMapped, "poses in the body around it"},
    {"replicate", nullptr, "3.1", kMapped, "the bodies that it stands for"},
    {"attach asset/model", nullptr, "3.2", kMapped, "the bodies of the model, with their drives"},
    {"composite", "type", "2.3", kRefused, kCables, old_composite},
    {"composite", "curve initial flat vertex size face quat", "2.3", kRefused, kCables},

    // Options.
    {"option", "integrator", "2.3", kLeftOut, kSimulation, old_integrator},
    {"option", "sdf_iterations sdf_initpoints ls_iterations ls_tolerance o_friction", "3.0",
     kLeftOut, kSimulation},
    {"option", "actuatorgroupdisable", "3.1", kLeftOut, kSimulation},
    {"option", "ccd_iterations ccd_tolerance", "3.2", kLeftOut, kSimulation},
    {"option", "sleep_tolerance", "3.4", kLeftOut, kSimulation},
    {"flag", "eulerdamp invdiscrete island midphase", "3.0", kLeftOut, kSimulation},
    {"flag", "nativeccd autoreset", "3.2", kLeftOut, kSimulation},
    {"flag", "spring damper sleep", "3.4", kLeftOut, kSimulation},
    {"flag", "diagexact", "3.9", kLeftOut, kSimulation},
    {"flag", "ipc", "3.14", kLeftOut, kSimulation},
    {"flag", "speculative", "4.0", kLeftOut, kSimulation},
    {"compiler", "assetdir", "2.3", kMapped, "`meshdir` and `texturedir`", nullptr,
     rename_asset_folder},
    {"compiler", "alignfree", "3.2", kLeftOut, kSimulation},
    {"compiler", "saveinertial", "3.3", kLeftOut, kFiles},
    {"compiler", "conflict", "3.10", kLeftOut, kFiles},
    {"compiler", "savecanonical savecompiled", "3.16", kLeftOut, kFiles},
    {"compiler", "passthrough", "4.0", kLeftOut, kFiles},

    // Bodies, joints, shapes.
    {"body", "gravcomp", "2.3", kMapped, "nothing, where it is 0", is_not_zero, take_out},
    {"body", "gravcomp", "2.3", kLeftOut, kWeightless},
    {"body", "sleep", "3.4", kLeftOut, kSimulation},
    {"body", "simple", "3.11", kLeftOut, kSimulation},
    {"body", "fuse", "3.16", kLeftOut, kSimulation},
    {"joint", "actuatorforcerange actuatorfrcrange", "2.3", kMapped, "the joint's limit of effort",
     nullptr, force_range},
    {"joint", "actuatorforcelimited actuatorfrclimited", "2.3", kMapped,
     "the joint's limit of effort", nullptr, force_limited},
    {"joint", "actuatorgravcomp", "3.1", kLeftOut, kWeightless},
    {"joint", "damping stiffness", "3.7", kMapped, "its first number, where the rest is 0",
     is_polynomial, keep_first_number},
    {"joint", "damping stiffness", "3.7", kRefused, kPolynomial, is_one_number},
    {"joint", "springyield", "4.0", kRefused,
     "a spring that yields is no spring of a joint here: remove it, or the spring"},
    {"freejoint", "align", "3.2", kLeftOut, kSimulation},
    {"geom", "type", "3.0", kRefused,
     "a signed distance field gives its body mass: state the body's <inertial>", old_geom},
    {"geom", "adhesion surfacevel", "3.11", kLeftOut, kContacts},
    {"geom", "castshadow", "4.0", kLeftOut, kLooks},
    {"site", "type", "3.13", kLeftOut, kLooks, old_site},
    {"site", "mesh", "3.13", kLeftOut, kLooks},
    {"mesh", "content_type maxhullvert", "2.3", kLeftOut, kLooks},
    {"mesh", "inertia", "3.2", kMapped, "`exactmeshinertia` of all meshes", nullptr, mesh_rule},
    {"mesh", "builtin params", "3.4", kRefused,
     "a shape that MuJoCo makes gives a body mass: state the body's <inertial>"},
    {"mesh/plugin", nullptr, "3.0", kRefused,
     "a shape that a plugin makes gives a body mass: state the body's <inertial>"},
    {"body/plugin geom/plugin composite/plugin worldbody/plugin asset/plugin extension", nullptr,
     "2.3", kLeftOut, kPlugins},
    {"deformable flexcomp equality/flex equality/flexvert equality/flexstrain", nullptr, "3.0",
     kLeftOut, kDeformable},

    // Tendons, constraints, contacts, postures.
    {"spatial fixed tendon", "armature actuatorfrclimited actuatorfrcrange", "3.3", kLeftOut,
     kTendons},
    {"spatial fixed tendon", "springyield", "4.0", kLeftOut, kTendons},
    {"spatial fixed tendon", "stiffness damping springlength", "2.3", kMapped, "its first number",
     is_one_number, keep_first_number},
    {"connect weld", "site1 site2", "3.2", kMapped, "the same between the bodies of the sites",
     nullptr, sites_to_bodies},
    {"pair", "solreffriction", "2.3", kLeftOut, kContacts},
    {"pair", "adhesion", "3.11", kLeftOut, kContacts},
    {"key", "plastic", "4.0", kLeftOut, kSimulation},

    // Drives: a tree has their place and their limit of effort.
    {"adhesion", nullptr, "2.2", kLeftOut, kContacts},
    {"actuator/plugin", nullptr, "2.3", kMapped, "a drive of the same range of force", nullptr,
     as_general},
    {"actuator/dcmotor actuator/orientation actuator/pid", nullptr, "3.7", kMapped,
     "a drive of the same range of force", nullptr, as_general},
    {"default/dcmotor default/orientation default/pid", nullptr, "3.7", kLeftOut, kDrives},
    {"general", "actdim", "2.3", kLeftOut, kDrives},
    {"general", "dyntype", "3.0", kLeftOut, kDrives, old_dynamics},
    {"general", "gaintype", "3.7", kLeftOut, kDrives, old_gain},
    {"general", "biastype", "3.7", kLeftOut, kDrives, old_bias},
    {"muscle", "tausmooth", "2.3", kLeftOut, kDrives},
    {"general", "actearly", "3.0", kLeftOut, kDrives},
    {"position", "kv", "3.1", kMapped, "what the joint's drive brakes", nullptr, drive_damping},
    {"position", "dampratio", "3.2", kMapped, "what the joint's drive brakes", nullptr,
     drive_damping_ratio},
    {"intvelocity", "kv", "3.1", kLeftOut, kDrives},
    {"intvelocity", "dampratio", "3.2", kLeftOut, kDrives},
    {"position intvelocity", "inheritrange", "3.1", kLeftOut, kDrives},
    {"position intvelocity", "timeconst", "3.2", kLeftOut, kDrives},
    {kAllDrives, "nsample interp delay", "3.5", kLeftOut, kDrives},
    {kAllDrives, "damping armature", "3.7", kMapped, "nothing, where it is 0", is_not_zero,
     take_out},
    {kAllDrives, "damping armature", "3.7", kRefused,
     "damping and rotor of a drive act at its joint: state them there, times the gear squared"},
    {"general", "input", "3.11", kLeftOut, kDrives},
    {"intvelocity", "actlimited", "3.11", kLeftOut, kDrives},
    {"general", "velrange ffrange", "3.12", kLeftOut, kDrives},
    {"general", "inheritrange", "3.16", kLeftOut, kDrives},
};

}  // namespace

std::span<const LaterWord> later_words() { return kWords; }

}  // namespace diffnea::io
