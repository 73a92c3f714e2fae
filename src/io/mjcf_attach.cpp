#include "io/mjcf_attach.hpp"

#include <cmath>
#include <cstring>
#include <initializer_list>
#include <set>
#include <utility>

#include <diffnea/core/error.hpp>

#include "io/mjcf_defaults.hpp"
#include "io/mjcf_limits.hpp"
#include "io/mjcf_meshes.hpp"
#include "io/mjcf_parts.hpp"
#include "io/mjcf_pose.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Attributes of <compiler> that have to be those of the document around it.
constexpr const char* kCommonOptions[] = {"autolimits",        "coordinate",     "inertiafromgeom",
                                          "inertiagrouprange", "balanceinertia", "boundmass",
                                          "boundinertia",      "settotalmass"};
/// Attributes besides kReferences that hold a name.
constexpr const char* kOtherNames[] = {"name", "class", "childclass", "mesh", "hfield"};

/// MuJoCo's own value where the document has none.
std::string compiler_option(XmlElement& root, const char* name) {
  std::string out = std::strcmp(name, "autolimits") == 0        ? "true"
                    : std::strcmp(name, "inertiafromgeom") == 0 ? "auto"
                                                                : "";
  for_each_child(root, "compiler", [&](XmlElement& c) {
    if (c.Attribute(name)) out = attribute(c, name);
  });
  return out;
}

/// Says orientations as quaternions and joints' angles in the unit of the document around it, which
/// a class cannot: it may be that of a slide.
void convert_angles(XmlElement& root, const MjcfAngles& wanted) {
  const MjcfAngles angles(root);
  if (angles.degrees == wanted.degrees && angles.euler == wanted.euler) return;
  const MjcfDefaults defaults(root);
  walk(root, [&](XmlElement& e) {
    if (!e.Attribute("euler") && !e.Attribute("axisangle")) return;
    const bool has_position = e.Attribute("pos") != nullptr;
    set_mjcf_pose(e, mjcf_pose(e, defaults, angles));
    if (!has_position) e.DeleteAttribute("pos");
  });
  if (angles.degrees == wanted.degrees) return;
  const double unit = angles.degrees ? M_PI / 180.0 : 180.0 / M_PI;
  const auto names = {"range", "ref", "springref"};
  for_each_child(root, "worldbody", [&](XmlElement& world) {
    walk(world, [&](XmlElement& joint) {
      if (!is(joint, "joint")) return;
      const bool slides = defaults.attribute(joint, "type") == "slide";
      for (const char* name : names) {
        std::string text;
        for (const double x : mjcf_numbers(defaults.attribute(joint, name)))
          text += (text.empty() ? "" : " ") + exact(slides ? x : x * unit);
        if (!text.empty()) joint.SetAttribute(name, text.c_str());
      }
    });
  });
  for_each_child(root, "default", [&](XmlElement& section) {
    walk(section, [&](XmlElement& joint) {
      if (!is(joint, "joint")) return;
      for (const char* name : names) joint.DeleteAttribute(name);
    });
  });
}

/// One <attach>, which is replaced.
class Attachment {
 public:
  Attachment(Mjcf& mjcf, XmlElement& attach, AttachedFile file)
      : mjcf_(mjcf),
        root_(*mjcf.document->RootElement()),
        attach_(attach),
        prefix_(attribute(attach, "prefix")),
        file_(std::move(file)),
        sub_(*file_.document->RootElement()) {}

  void replace() {
    check_options();
    convert_angles(sub_, MjcfAngles(root_));
    name_meshes();
    give_prefix();
    const std::vector<XmlElement*> bodies = attached_bodies();
    std::set<std::string> names;
    tinyxml2::XMLNode* after = &attach_;
    for (XmlElement* body : bodies) {
      XmlElement* copy = clone_with_places(*body, *mjcf_.document);
      set_class(*copy);
      walk(*copy, [&](XmlElement& e) { names.insert(attribute(e, "name")); });
      after = attach_.Parent()->InsertAfterChild(after, copy);
    }
    add_classes();
    add_children("asset", [](XmlElement&) { return true; });
    for_each_child(sub_, "tendon", [&](XmlElement& section) {
      for_each_child(section, nullptr, [&](XmlElement& e) { names.insert(attribute(e, "name")); });
    });
    for (const char* section : kSectionsThatRefer)
      add_children(section, [&](XmlElement& e) { return refers_only_to(e, names); });
    attach_.Parent()->DeleteChild(&attach_);
  }

 private:
  [[noreturn]] void refuse(const std::string& why) const {
    throw ModelError(mjcf_.where + ": " + mjcf_.line(attach_) + ": <attach> " + why +
                     "; let a current MuJoCo write one file (mj_saveLastXML)");
  }

  void check_options() {
    if (attach_.Attribute("frame")) refuse("names a frame, expected a body");
    for (const char* name : kCommonOptions) {
      const std::string ours = compiler_option(root_, name), theirs = compiler_option(sub_, name);
      if (ours != theirs)
        refuse("names a model whose <compiler> has " + std::string(name) + " = '" + theirs +
               "', and the document has '" + ours + "'");
    }
    for_each_child(root_, "default", [&](XmlElement& section) {
      for_each_child(section, nullptr, [&](XmlElement& e) {
        if (!is(e, "default"))
          refuse("stands in a document with defaults of no class, which would count for the model");
      });
    });
    bool generates = false;
    walk(sub_, [&](XmlElement& e) { generates |= is(e, "replicate") || is(e, "attach"); });
    if (generates) refuse("names a model with <replicate> or <attach>");
  }

  /// Names meshes after their files before these change: they are named from the document's folder.
  void name_meshes() {
    const std::filesystem::path from = mjcf_.folder / mesh_folder(root_),
                                folder = file_.folder / mesh_folder(sub_);
    walk(sub_, [&](XmlElement& mesh) {
      if (!is(mesh, "mesh") || !mesh.Attribute("file")) return;
      mesh.SetAttribute("name", mesh_name(mesh).c_str());
      const std::filesystem::path file =
          std::filesystem::absolute(folder / attribute(mesh, "file")).lexically_normal();
      mesh.SetAttribute(
          "file",
          file.lexically_relative(std::filesystem::absolute(from).lexically_normal()).c_str());
    });
  }

  void give_prefix() {
    for_each_child(sub_, nullptr, [&](XmlElement& section) {
      walk(section, [&](XmlElement& e) {
        const auto prepend = [&](const char* name) {
          if (e.Attribute(name) && attribute(e, name) != "world")
            e.SetAttribute(name, (prefix_ + attribute(e, name)).c_str());
        };
        for (const char* name : kReferences) prepend(name);
        for (const char* name : kOtherNames) prepend(name);
      });
    });
  }

  std::vector<XmlElement*> attached_bodies() {
    const std::string name = attribute(attach_, "body");
    std::vector<XmlElement*> out;
    for_each_child(sub_, "worldbody", [&](XmlElement& world) {
      if (name.empty())
        for_each_child(world, nullptr, [&](XmlElement& e) { out.push_back(&e); });
      else if (XmlElement* body = find_named(world, "body", prefix_ + name))
        out.push_back(body);
    });
    if (out.empty()) refuse("names no body of the model: '" + name + "'");
    return out;
  }

  /// Class of an element that names none, which is the model's own.
  void set_class(XmlElement& e) const {
    const char* name = is(e, "body") || is(e, "frame") ? "childclass" : "class";
    if (!e.Attribute(name)) e.SetAttribute(name, (prefix_ + "main").c_str());
  }

  /// The model's classes below one of its own.
  void add_classes() {
    XmlElement* own = child(root_, "default").InsertNewChildElement("default");
    own->SetAttribute("class", (prefix_ + "main").c_str());
    for_each_child(sub_, "default", [&](XmlElement& section) {
      for_each_child(section, nullptr, [&](XmlElement& e) {
        own->InsertEndChild(clone_with_places(e, *mjcf_.document));
      });
    });
  }

  template <class Wanted>
  void add_children(const char* name, Wanted wanted) {
    for_each_child(sub_, name, [&](XmlElement& section) {
      XmlElement& target = child(root_, name);
      for_each_child(section, nullptr, [&](XmlElement& e) {
        if (!wanted(e)) return;
        XmlElement* copy = clone_with_places(e, *mjcf_.document);
        if (std::strcmp(name, "asset") == 0 ? is(e, "mesh") : !is(e, "exclude")) set_class(*copy);
        target.InsertEndChild(copy);
      });
    });
  }

  static bool refers_only_to(XmlElement& e, const std::set<std::string>& names) {
    bool known = true;
    walk(e, [&](XmlElement& c) {
      for (const char* name : kReferences)
        if (c.Attribute(name))
          known &= names.contains(attribute(c, name)) || attribute(c, name) == "world";
    });
    return known;
  }

  Mjcf& mjcf_;
  XmlElement& root_;
  XmlElement& attach_;
  std::string prefix_;
  AttachedFile file_;
  XmlElement& sub_;
};

XmlElement* find_attach(XmlElement& element) {
  for (XmlElement* e = element.FirstChildElement(); e; e = e->NextSiblingElement()) {
    if (is(*e, "attach")) return e;
    if (XmlElement* found = find_attach(*e)) return found;
  }
  return nullptr;
}

}  // namespace

void attach_models(Mjcf& mjcf, const ReadAttached& read) {
  XmlElement& root = *mjcf.document->RootElement();
  const auto model_named = [&](const std::string& name) {
    XmlElement* found = nullptr;
    for_each_child(root, "asset", [&](XmlElement& asset) {
      for_each_child(asset, "model", [&](XmlElement& model) {
        const std::string own = model.Attribute("name")
                                    ? attribute(model, "name")
                                    : attribute(*read(model).document->RootElement(), "model");
        if (own == name) found = &model;
      });
    });
    return found;
  };
  while (XmlElement* attach = find_attach(root)) {
    XmlElement* model = model_named(attribute(*attach, "model"));
    if (!model)
      throw ModelError(mjcf.where + ": " + mjcf.line(*attach) + ": <attach> names the model '" +
                       attribute(*attach, "model") + "', which no <asset> has");
    Attachment(mjcf, *attach, read(*model)).replace();
    check_mjcf(root, mjcf.where);  // while it grows
  }
  for_each_child(root, "asset", [](XmlElement& asset) { remove_children(asset, "model"); });
}

}  // namespace diffnea::io
