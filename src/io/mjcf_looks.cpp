/// Shapes of an MJCF that need files: those that give mass stay, looks go.

#include <algorithm>
#include <initializer_list>
#include <map>
#include <set>
#include <utility>

#include <diffnea/core/error.hpp>

#include "io/mjcf_defaults.hpp"
#include "io/mjcf_inertial.hpp"
#include "io/mjcf_meshes.hpp"
#include "io/mjcf_parts.hpp"
#include "io/mjcf_pose.hpp"

namespace diffnea::io {
namespace {

/// True if all numbers of an attribute are 0; false if there are none.
bool is_zero_text(const std::string& text) {
  const std::vector<double> x = mjcf_numbers(text);
  return !x.empty() && std::ranges::all_of(x, [](double v) { return v == 0.0; });
}

/// The shapes that meshes have, and which of them bodies are weighed by.
class MeshUse {
 public:
  MeshUse(XmlElement& root, const Mjcf& mjcf, bool weigh_all)
      : mjcf_(mjcf), defaults_(root), weigh_all_(weigh_all), folder_(mesh_folder(root)) {
    for_each_child(root, "compiler", [&](XmlElement& c) {
      if (const auto range = mjcf_numbers(attribute(c, "inertiagrouprange")); range.size() == 2)
        groups_ = {range[0], range[1]};
    });
    for_each_child(root, "asset", [&](XmlElement& asset) {
      for_each_child(asset, "mesh", [&](XmlElement& mesh) { meshes_[mesh_name(mesh)] = &mesh; });
    });
  }

  /// True if a mesh gives the body some of its mass.
  bool weighs(const XmlElement& body, const XmlElement& geom) const {
    if (!is(body, "body") || (body.FirstChildElement("inertial") && !weigh_all_)) return false;
    const std::string mass = defaults_.attribute(geom, "mass"),
                      group = defaults_.attribute(geom, "group");
    if (is_zero_text(mass) || (mass.empty() && is_zero_text(defaults_.attribute(geom, "density"))))
      return false;
    const std::vector<double> g = mjcf_numbers(group);
    const double in_group = g.empty() ? 0.0 : g[0];
    return in_group >= groups_.first && in_group <= groups_.second;
  }
  /// @throws ModelError if it lies where none may
  bool is_there(const std::string& name) const {
    const auto mesh = meshes_.find(name);
    if (mesh == meshes_.end() || !mesh->second->Attribute("file")) return true;
    try {
      confined_path(mjcf_.folder, (folder_ / attribute(*mesh->second, "file")).string(),
                    mjcf_.reading.allow_outside, mjcf_.where + ": mesh '" + name + "'");
    } catch (const FileError&) {
      return false;
    }
    return true;
  }
  /// True if a joint moves the body.
  static bool moves(const XmlElement& body) {
    for (const XmlElement* b = &body; b && is(*b, "body"); b = b->Parent()->ToElement())
      if (b->FirstChildElement("joint") || b->FirstChildElement("freejoint")) return true;
    return false;
  }

 private:
  const Mjcf& mjcf_;
  MjcfDefaults defaults_;
  bool weigh_all_;
  std::filesystem::path folder_;
  std::pair<double, double> groups_{0.0, 5.0};  ///< MuJoCo's default
  std::map<std::string, const XmlElement*> meshes_;
};

/// Shapes that a class names become those of its geoms, where they can be taken away one by one.
void spread_shapes(XmlElement& root) {
  const MjcfDefaults defaults(root);
  const auto names = {"mesh", "hfield"};
  walk(root, [&](XmlElement& e) {
    if (!is(e, "geom") || is(*e.Parent()->ToElement(), "default")) return;
    for (const char* name : names)
      if (const std::string shape = defaults.attribute(e, name); !shape.empty())
        e.SetAttribute(name, shape.c_str());
  });
  walk(root, [&](XmlElement& e) {
    if (!is(e, "default")) return;
    for_each_child(e, "geom", [&](XmlElement& geom) {
      for (const char* name : names) geom.DeleteAttribute(name);
    });
  });
}

/// Makes a geom one that needs no file and weighs nothing; its name, place and contacts stay.
void mark(XmlElement& geom) {
  geom.DeleteChildren();
  for (const char* name : {"mesh", "hfield"}) geom.DeleteAttribute(name);
  geom.SetAttribute("type", "box");
  geom.SetAttribute("size", "0.001 0.001 0.001");
  geom.SetAttribute("mass", "0");
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

}  // namespace

bool inertia_from_geoms(XmlElement& root) {
  bool forced = false;
  for_each_child(root, "compiler",
                 [&](XmlElement& c) { forced |= attribute(c, "inertiafromgeom") == "true"; });
  return forced;
}

void strip_looks(XmlElement& root, const Mjcf& mjcf, bool weigh_all, LostShape lost,
                 std::vector<std::string>& notes) {
  std::set<std::string> used_meshes, gone;
  std::vector<std::string> weighed, unweighed;
  spread_shapes(root);
  const MeshUse meshes(root, mjcf, weigh_all);
  const auto add = [&](std::vector<std::string>& names, const XmlElement& body) {
    const std::string named = attribute(body, "name"),
                      name = named.empty() ? "the body in " + mjcf.line(body) : "'" + named + "'";
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  };
  walk(root, [&](XmlElement& e) {
    for_each_child(e, nullptr, [&](XmlElement& c) {
      const char* mesh = c.Attribute("mesh");
      if (is(c, "hfield")) {
        e.DeleteChild(&c);
      } else if (is(c, "geom") && !is(e, "default") && (mesh || c.Attribute("hfield"))) {
        if (mesh && meshes.weighs(e, c)) {
          if (MeshUse::moves(e)) {
            add(weighed, e);
            used_meshes.insert(mesh);
            return;
          }
          if (meshes.is_there(mesh)) {
            used_meshes.insert(mesh);
            return;
          }
          add(unweighed, e);
          if (!e.FirstChildElement("inertial")) write_mjcf_inertial(e, {});
        }
        if (lost == LostShape::kMarked) {
          mark(c);
        } else {
          gone.insert(attribute(c, "name"));
          e.DeleteChild(&c);
        }
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
      if (!used_meshes.contains(mesh_name(mesh))) asset.DeleteChild(&mesh);
    });
  });
  if (!weighed.empty())
    notes.push_back("meshes give " + joined(weighed) + " their inertia, by the rule of MuJoCo " +
                    mj_versionString() +
                    " (2.2 counts the volume of a concave mesh too large, unless it says "
                    "inertia=\"exact\"); versions differ, by up to a half of the mass: state "
                    "<inertial>");
  if (!unweighed.empty())
    notes.push_back("the mass of " + joined(unweighed) +
                    ", which does not move, is left out: its mesh is not there");
}

}  // namespace diffnea::io
