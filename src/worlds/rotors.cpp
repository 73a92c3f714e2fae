#include <diffnea/core/error.hpp>
#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/worlds/world.hpp>

#include "io/xml.hpp"
#include "sim/rotor_names.hpp"

namespace diffnea {
namespace {

using io::XmlElement;

void add_rotor(XmlElement& world, const std::string& name) {
  XmlElement& body = *world.InsertNewChildElement("body");
  XmlElement& joint = *body.InsertNewChildElement("joint");
  joint.SetAttribute("name", name.c_str());
  joint.SetAttribute("type", "hinge");
  joint.SetAttribute("axis", "0 0 1");
  joint.SetAttribute("limited", "false");
  for (const char* none : {"armature", "damping", "frictionloss", "stiffness"})
    joint.SetAttribute(none, "0");
  // It turns about its centre of mass; its inertia is its joint's armature.
  XmlElement& inertial = *body.InsertNewChildElement("inertial");
  inertial.SetAttribute("pos", "0 0 0");
  inertial.SetAttribute("mass", "1e-9");
  inertial.SetAttribute("diaginertia", "1e-12 1e-12 1e-12");
}

void add_spring(XmlElement& tendons, const std::string& joint) {
  XmlElement& tendon = *tendons.InsertNewChildElement("fixed");
  tendon.SetAttribute("name", sim::spring_name(joint).c_str());
  tendon.SetAttribute("limited", "false");
  for (const bool rotor : {true, false}) {
    XmlElement& end = *tendon.InsertNewChildElement("joint");
    end.SetAttribute("joint", (rotor ? sim::rotor_name(joint) : joint).c_str());
    end.SetAttribute("coef", rotor ? "1" : "-1");
  }
}

}  // namespace

std::string with_rotors(const std::string& mjcf, const Model& truth) {
  std::unique_ptr<io::XmlDocument> document;
  const std::vector<std::string> joints = joint_names(truth);
  for (const EffectSpec& spec : truth.effects) {
    if (find_effect(spec.effect).motor != HiddenMotor::kSpring) continue;
    if (!document) document = io::parse_xml(mjcf, truth.source);
    XmlElement& root = *document->RootElement();
    for (const int j : bind(spec, truth).joints) {
      const std::string& joint = joints[static_cast<std::size_t>(j)];
      if (!io::find_named(root, "joint", joint))
        throw ModelError(truth.source + ": joint '" + joint +
                         "' has no name in the document, so that no rotor can be tied to it; "
                         "give it one, or leave its " +
                         spec.effect + " out");
      add_rotor(io::child(root, "worldbody"), sim::rotor_name(joint));
      add_spring(io::child(root, "tendon"), joint);
    }
    io::remove_children(root, "keyframe");  // postures no longer fit
  }
  return document ? io::xml_text(*document) : mjcf;
}

}  // namespace diffnea
