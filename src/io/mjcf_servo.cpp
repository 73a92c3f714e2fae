#include "io/mjcf_servo.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/effects/bound_effect.hpp>

#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

const std::string kPositionServo = "position_servo", kOffset = "torque_offset";

/// A servo's parameter that has no effect.
double none_of(const std::string& name) {
  for (const ParameterInfo& p : find_effect(kPositionServo).parameters)
    if (p.name == name) return p.initial;
  return 0.0;
}

/// A parameter of an effect, or what it is where it is absent.
double value_of(const EffectSpec& effect, const std::string& name) {
  for (const EffectParameter& p : effect.parameters)
    if (p.name == name) return p.value;
  return none_of(name);
}

}  // namespace

std::vector<ServoActuator> take_servos(Model& model, bool delays, std::vector<std::string>& notes) {
  std::vector<ServoActuator> out;
  std::vector<EffectSpec> rest;
  for (const EffectSpec& e : model.effects) {
    const auto link = std::ranges::find_if(model.links, [&](const ModelLink& l) {
      return l.type != ModelJoint::kFixed && l.joint == e.where;
    });
    if (e.effect != kPositionServo || link == model.links.end()) {
      rest.push_back(e);
      continue;
    }
    const double kp = value_of(e, "stiffness"), reach = value_of(e, "reach"),
                 damping = value_of(e, "damping");
    const bool bounded = reach < none_of("reach");
    // Within the bound the drive brakes by itself, beyond it the joint does.
    const double kd = bounded ? std::min(kp * value_of(e, "derivative_time"), damping) : 0.0;
    out.push_back(
        {e.where, kp, kd, bounded ? kp * reach : std::numeric_limits<double>::infinity(), 0.0});
    const double delay = value_of(e, "delay");
    if (delays && delay > 0.0) out.back().delay = delay;  // none acts before it is told
    for (const char* name : {"delay", "dead_band", "speed"})
      if (value_of(e, name) != none_of(name) &&
          !(name == std::string("delay") && out.back().delay > 0.0))
        notes.push_back(std::string(name) + " of the position servo at " + e.where + " = " +
                        exact(value_of(e, name)));
    const std::string unit = link->type == ModelJoint::kPrismatic ? "N*s/m" : "N*m*s/rad";
    rest.push_back({"viscous_friction", e.where, {{"viscous", damping - kd, unit}}});
  }
  model.effects = std::move(rest);
  for (ServoActuator& servo : out) {  // an offset is what the drive gives beyond its motion's need
    const auto offset = std::ranges::find_if(model.effects, [&](const EffectSpec& e) {
      return e.effect == kOffset && e.where == servo.joint && e.parameters.size() == 1;
    });
    if (offset == model.effects.end()) continue;
    servo.bias = -offset->parameters.front().value;
    model.effects.erase(offset);
  }
  return out;
}

void add_file_servos(const Model& model, std::vector<ServoActuator>& servos) {
  for (const ModelLink& link : model.links)
    if (link.servo && std::ranges::find(servos, link.joint, &ServoActuator::joint) == servos.end())
      servos.push_back({link.joint, link.servo->kp, link.servo->kd, link.limits.effort, 0.0});
}

namespace {

bool is_bounded(const ServoActuator& servo) {  // no range of MuJoCo's is empty
  return std::isfinite(servo.force) && servo.force > 0.0;
}
std::string force_range(const ServoActuator& servo) {
  return exact(servo.bias - servo.force) + " " + exact(servo.bias + servo.force);
}

/// Writes a delay and the buffer of commands that it needs: one of too few steps is a shorter
/// delay.
void write_delay(XmlElement& actuator, double delay) {
  constexpr double kStep = 5e-4;  // finest step of a simulation for which the buffer is enough [s]
  if (!(delay > 0.0)) return;
  actuator.SetAttribute("delay", exact(delay).c_str());
  actuator.SetAttribute("nsample", static_cast<int>(std::ceil(delay / kStep)) + 1);
  actuator.SetAttribute("interp", "linear");
}

/// Makes an actuator, of any kind, the servo; its name, joint and range of commands stay. Its class
/// says nothing that is not overruled.
void write_servo(XmlElement& actuator, const ServoActuator& servo) {
  const auto text = [&](const char* name) {
    const char* value = actuator.Attribute(name);
    return std::string(value ? value : "");
  };
  const std::string name = text("name"), range = text("ctrlrange"), limited = text("ctrllimited"),
                    of_class = text("class");
  const bool was_position = std::string(actuator.Name()) == "position";
  while (const tinyxml2::XMLAttribute* a = actuator.FirstAttribute())
    actuator.DeleteAttribute(a->Name());
  actuator.DeleteChildren();
  // `general` says all of it in every version; `position` would take kv from its class.
  actuator.SetName("general");
  actuator.SetAttribute("name", name.empty() ? servo.joint.c_str() : name.c_str());
  if (!of_class.empty()) actuator.SetAttribute("class", of_class.c_str());
  actuator.SetAttribute("joint", servo.joint.c_str());
  actuator.SetAttribute("gear", "1");
  actuator.SetAttribute("dyntype", "none");
  actuator.SetAttribute("gaintype", "fixed");
  actuator.SetAttribute("gainprm", (exact(servo.kp) + " 0 0").c_str());
  actuator.SetAttribute("biastype", "affine");
  actuator.SetAttribute(
      "biasprm", (exact(servo.bias) + " " + exact(-servo.kp) + " " + exact(-servo.kd)).c_str());
  actuator.SetAttribute("forcelimited", is_bounded(servo) ? "true" : "false");
  if (is_bounded(servo)) actuator.SetAttribute("forcerange", force_range(servo).c_str());
  write_delay(actuator, servo.delay);
  // A range of torques is none of positions.
  if (was_position && !range.empty()) {
    actuator.SetAttribute("ctrllimited", limited.empty() ? "true" : limited.c_str());
    actuator.SetAttribute("ctrlrange", range.c_str());
  } else {
    actuator.SetAttribute("ctrllimited", "false");
  }
}

/// Adds a servo the way a user would write it, where no class has its own idea of a `position`.
void add_servo(XmlElement& section, const ServoActuator& servo) {
  XmlElement& actuator = *section.InsertNewChildElement("position");
  actuator.SetAttribute("name", servo.joint.c_str());
  actuator.SetAttribute("joint", servo.joint.c_str());
  actuator.SetAttribute("kp", exact(servo.kp).c_str());
  write_delay(actuator, servo.delay);
  if (!is_bounded(servo)) return;
  actuator.SetAttribute("forcelimited", "true");
  actuator.SetAttribute("forcerange", force_range(servo).c_str());
}

/// Lets dry friction of a servo's joint hold, as in the fit, unless the file says how it does. By
/// MuJoCo's default a joint slides for 10 ms of its deceleration before friction is all there.
void write_held_friction(XmlElement& root, const std::vector<ServoActuator>& servos) {
  // Two steps of 1 ms; of longer ones MuJoCo takes two itself.
  constexpr const char *kName = "solreffriction", *kHeld = "0.002 1";
  bool in_class = false;
  std::vector<XmlElement*> joints;
  walk(root, [&](XmlElement& e) {
    if (!is(e, "joint")) return;
    const char* name = e.Attribute("name");
    in_class = in_class || (!name && e.Attribute(kName));
    const XmlElement* in = e.Parent()->ToElement();
    if (name && in && (is(*in, "body") || is(*in, "frame")) &&
        std::ranges::find(servos, name, &ServoActuator::joint) != servos.end())
      joints.push_back(&e);
  });
  for (XmlElement* joint : joints)
    if (!in_class && !joint->Attribute(kName)) joint->SetAttribute(kName, kHeld);
}

}  // namespace

void write_servos(XmlElement& root, const std::vector<ServoActuator>& servos) {
  write_held_friction(root, servos);
  for (const ServoActuator& servo : servos) {
    XmlElement* found = nullptr;
    for_each_child(root, "actuator", [&](XmlElement& section) {
      for_each_child(section, nullptr, [&](XmlElement& e) {
        const char* joint = e.Attribute("joint");
        if (!found && joint && servo.joint == joint) found = &e;
      });
    });
    if (!found && !root.FirstChildElement("default") && servo.kd == 0.0 && servo.bias == 0.0) {
      add_servo(child(root, "actuator"), servo);
      continue;
    }
    if (!found) found = child(root, "actuator").InsertNewChildElement("general");
    write_servo(*found, servo);
  }
}

}  // namespace diffnea::io
