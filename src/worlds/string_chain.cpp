#include "worlds/string_chain.hpp"

#include <cstdio>

#include <diffnea/core/error.hpp>

#include "core/c_numbers.hpp"
#include "io/model_parts.hpp"
#include "io/xml.hpp"

namespace diffnea::io {
namespace {

/// Without some inertia beside that of a thin link's, MuJoCo's steps are not stable (1e-9 gives
/// NaNs).
constexpr double kArmature = 3e-7;  // [kg·m²]
constexpr double kRadius = 8e-4;    // [m]

XmlElement& add(XmlElement& parent, const char* tag) { return *parent.InsertNewChildElement(tag); }

/// Takes an element out, and what held nothing but it.
void remove(XmlElement& element) {
  XmlElement* parent = element.Parent()->ToElement();
  parent->DeleteChild(&element);
  if (!parent->FirstChildElement()) parent->Parent()->DeleteChild(parent);
}

/// Postures of a keyframe no longer fit.
void remove_keyframes(XmlElement& root) {
  for_each_child(root, "keyframe", [&](XmlElement& e) { root.DeleteChild(&e); });
}

void add_hinges(XmlElement& body, const std::string& name, const Rope& rope,
                const Vec3<double>& at) {
  for (const bool second : {false, true}) {
    XmlElement& joint = add(body, "joint");
    joint.SetAttribute("name", (name + (second ? "_y" : "_x")).c_str());
    joint.SetAttribute("type", "hinge");
    joint.SetAttribute("limited", "false");
    joint.SetAttribute("axis", second ? "0 1 0" : "1 0 0");
    joint.SetAttribute("pos", exact(at).c_str());
    joint.SetAttribute("damping", exact(rope.damping).c_str());
    joint.SetAttribute("armature", exact(kArmature).c_str());
    joint.SetAttribute("frictionloss", "0");
    joint.SetAttribute("stiffness", "0");
  }
}

/// A link of the chain, along −z from its origin.
XmlElement& add_link(XmlElement& parent, int k, const Vec3<double>& at, double length,
                     const Rope& rope) {
  const std::string name = "string_" + std::to_string(k);
  XmlElement& body = add(parent, "body");
  body.SetAttribute("name", name.c_str());
  body.SetAttribute("pos", exact(at).c_str());
  add_hinges(body, name, rope, {0, 0, 0});
  const double mass = rope.mass / rope.links, about = mass * length * length / 12.0;
  XmlElement& inertial = add(body, "inertial");
  inertial.SetAttribute("pos", exact(Vec3<double>{0, 0, -0.5 * length}).c_str());
  inertial.SetAttribute("mass", exact(mass).c_str());
  inertial.SetAttribute("diaginertia",
                        exact(Vec3<double>{about, about, 0.5 * mass * kRadius * kRadius}).c_str());
  XmlElement& geom = add(body, "geom");
  geom.SetAttribute("type", "capsule");
  geom.SetAttribute("size", exact(kRadius).c_str());
  geom.SetAttribute("fromto", ("0 0 0 " + exact(Vec3<double>{0, 0, -length})).c_str());
  // Hits what the ball hits, and neither the ball nor itself.
  geom.SetAttribute("contype", "2");
  geom.SetAttribute("conaffinity", "1");
  return body;
}

}  // namespace

std::string with_chain(const std::string& mjcf, const Model& nominal, const Model& truth,
                       const Rope& rope) {
  const std::string& where = truth.source;
  const std::unique_ptr<XmlDocument> document = parse_xml(mjcf, where);
  XmlElement& root = *document->RootElement();
  XmlElement *tendon = find_named(root, "spatial", "string"),
             *ball = find_named(root, "body", "ball");
  XmlElement* site = nullptr;
  if (tendon && ball)
    for_each_child(*tendon, "site", [&](XmlElement& s) {
      const std::string name = attribute(s, "site");
      if (!find_named(*ball, "site", name)) site = find_named(root, "site", name);
    });
  if (!site || !nominal.ball || !nominal.ball->string || !truth.ball || !truth.ball->string)
    throw ModelError(where +
                     ": there is no string to put a chain in place of; expected a free "
                     "body 'ball' and a spatial tendon 'string' from a site on the arm");
  const double radius = truth.ball->radius;
  const double length = (truth.ball->string->length - radius) / rope.links;
  if (!(length > 0.0) || rope.links < 1)
    throw ModelError(where + ": a string of " + exact(truth.ball->string->length) +
                     " m ends within the ball, whose radius is " + exact(radius) + " m");

  Vec3<double> at = truth.ball->string->p_LS - nominal.ball->string->p_LS;
  double own[3] = {0, 0, 0};
  const std::string position = attribute(*site, "pos");
  const detail::CNumbers point;
  if (!position.empty() && std::sscanf(position.c_str(), "%lf %lf %lf", own, own + 1, own + 2) != 3)
    throw ModelError(where + ": site '" + attribute(*site, "name") + "' has no position");
  at = at + Vec3<double>{own[0], own[1], own[2]};

  XmlElement* parent = site->Parent()->ToElement();
  for (int k = 0; k < rope.links; ++k) {
    parent = &add_link(*parent, k, at, length, rope);
    at = {0, 0, -length};
  }
  XmlElement* hung = parent->InsertEndChild(ball->DeepClone(document.get()))->ToElement();
  for (const char* free : {"joint", "freejoint"}) remove_children(*hung, free);
  for (const char* placed : {"quat", "euler", "axisangle", "xyaxes", "zaxis"})
    hung->DeleteAttribute(placed);
  hung->SetAttribute("pos", exact(Vec3<double>{0, 0, -length - radius}).c_str());
  add_hinges(*hung, "string_knot", rope, {0, 0, radius});
  remove(*ball);
  remove(*tendon);
  remove_keyframes(root);
  return xml_text(*document);
}

std::string without_ball(const std::string& mjcf, const Model& truth) {
  const std::unique_ptr<XmlDocument> document = parse_xml(mjcf, truth.source);
  XmlElement& root = *document->RootElement();
  if (XmlElement* tendon = find_named(root, "spatial", "string")) remove(*tendon);
  if (XmlElement* ball = find_named(root, "body", "ball")) remove(*ball);
  remove_keyframes(root);
  return xml_text(*document);
}

}  // namespace diffnea::io
