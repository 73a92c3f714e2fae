/// The document of an MJCF before MuJoCo compiles it: includes in place, nothing that needs a file
/// without giving mass, meshes from the model's folder alone.

#include <cstring>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_limits.hpp"
#include "io/mjcf_meshes.hpp"
#include "io/mjcf_parts.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Includes in includes; a chain this long is a mistake or an attack.
constexpr int kMaxIncludeDepth = 16;

void expand(XmlElement& element, const std::filesystem::path& folder, const std::string& where,
            std::set<std::filesystem::path>& seen, int depth) {
  if (depth > kMaxIncludeDepth) throw ModelError(where + ": includes are nested too deeply");
  for_each_child(element, nullptr, [&](XmlElement& e) {
    if (std::strcmp(e.Name(), "include") != 0) return expand(e, folder, where, seen, depth);
    const std::string name = attribute(e, "file");
    if (name.empty()) throw ModelError(where + ": <include> names no file");
    const std::filesystem::path path = confined_path(folder, name, where + ": <include>");
    if (!seen.insert(path).second)  // MuJoCo's own rule
      throw ModelError(where + ": includes '" + name + "' more than once");
    const std::unique_ptr<XmlDocument> included = parse_xml(read_text_file(path), path.string());
    expand(*included->RootElement(), folder, where, seen, depth + 1);
    tinyxml2::XMLNode* after = &e;
    for (XmlElement* c = included->RootElement()->FirstChildElement(); c;
         c = c->NextSiblingElement())
      after = element.InsertAfterChild(after, c->DeepClone(element.GetDocument()));
    element.DeleteChild(&e);
  });
}

/// The compiler would simulate an actuator to learn its length, for as long as the document says,
/// and make room for a simulation and its sensors. No model holds any of it.
void without_simulation(XmlElement& root) {
  for (const char* name : {"size", "sensor"}) remove_children(root, name);
  for_each_child(root, "compiler", [](XmlElement& c) { remove_children(c, "lengthrange"); });
  child(child(root, "compiler"), "lengthrange").SetAttribute("mode", "none");
}

/// Makes a geom one that needs no file and weighs nothing; its name, place and contacts stay.
void mark(XmlElement& geom) {
  geom.DeleteChildren();
  for (const char* name : {"mesh", "hfield"}) geom.DeleteAttribute(name);
  geom.SetAttribute("type", "box");
  geom.SetAttribute("size", "0.001 0.001 0.001");
  geom.SetAttribute("mass", "0");
}

}  // namespace

bool inertia_from_geoms(XmlElement& root) {
  bool forced = false;
  for_each_child(root, "compiler",
                 [&](XmlElement& c) { forced |= attribute(c, "inertiafromgeom") == "true"; });
  return forced;
}

void strip_looks(XmlElement& root, bool weigh_all, LostShape lost) {
  std::set<std::string> used_meshes, gone;
  for_each_child(root, "visual", [&](XmlElement& e) { root.DeleteChild(&e); });
  for_each_child(root, "statistic", [&](XmlElement& e) { root.DeleteChild(&e); });
  walk(root, [&](XmlElement& e) {
    for_each_child(e, nullptr, [&](XmlElement& c) {
      const bool states_inertia = e.FirstChildElement("inertial") && !weigh_all;
      if (is(c, "texture") || is(c, "hfield") || is(c, "skin")) {
        e.DeleteChild(&c);
      } else if (is(c, "geom") &&
                 (c.Attribute("hfield") || (c.Attribute("mesh") && states_inertia))) {
        if (lost == LostShape::kMarked) {
          mark(c);
        } else {
          gone.insert(attribute(c, "name"));
          e.DeleteChild(&c);
        }
      } else if (is(c, "geom") && c.Attribute("mesh")) {
        used_meshes.insert(attribute(c, "mesh"));
      } else if (is(c, "material")) {
        c.DeleteAttribute("texture");
      }
    });
  });
  for_each_child(root, "contact", [&](XmlElement& contact) {
    for_each_child(contact, "pair", [&](XmlElement& pair) {
      if (gone.contains(attribute(pair, "geom1")) || gone.contains(attribute(pair, "geom2")))
        contact.DeleteChild(&pair);
    });
  });
  for_each_child(root, "asset", [&](XmlElement& asset) {
    for_each_child(asset, "mesh", [&](XmlElement& mesh) {
      std::string name = attribute(mesh, "name");
      if (name.empty()) name = std::filesystem::path(attribute(mesh, "file")).stem().string();
      if (!used_meshes.contains(name)) asset.DeleteChild(&mesh);
    });
  });
}

Mjcf expand_mjcf(const std::string& text, const std::filesystem::path& folder,
                 const std::string& where) {
  Mjcf out{parse_xml(text, where), folder.empty() ? std::filesystem::path(".") : folder, where};
  std::set<std::filesystem::path> seen;
  expand(*out.document->RootElement(), out.folder, where, seen, 0);
  check_mjcf(*out.document->RootElement(), where);
  return out;
}

MujocoModel compile_mjcf(const Mjcf& mjcf) {
  XmlDocument document;
  mjcf.document->DeepCopy(&document);
  XmlElement& root = *document.RootElement();
  strip_looks(root, inertia_from_geoms(root), LostShape::kMarked);
  without_simulation(root);
  sim::MujocoFiles files;
  add_meshes(root, mjcf.folder, mjcf.where, files);
  return sim::compile_mujoco(xml_text(document), files, mjcf.where);
}

}  // namespace diffnea::io
