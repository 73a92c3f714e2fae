#include "io/urdf.hpp"

#include <algorithm>
#include <cmath>
#include <console_bridge/console.h>
#include <map>
#include <mutex>
#include <set>

#include <urdf_parser/urdf_parser.h>

#include <diffnea/core/error.hpp>

#include "io/inertia_start.hpp"
#include "io/model_parts.hpp"
#include "io/urdf_elements.hpp"
#include "io/urdf_repairs.hpp"
#include "io/xml.hpp"

namespace diffnea::io {
namespace {

/// Collects what urdfdom would print. console_bridge has one handler for the process: hence the
/// lock.
class CollectErrors : public console_bridge::OutputHandler {
 public:
  CollectErrors() : lock_(mutex()) { console_bridge::useOutputHandler(this); }
  ~CollectErrors() override { console_bridge::restorePreviousOutputHandler(); }
  CollectErrors(const CollectErrors&) = delete;
  CollectErrors& operator=(const CollectErrors&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR)
      text_ += (text_.empty() ? "" : "; ") + text;
  }
  const std::string& text() const { return text_; }

 private:
  static std::mutex& mutex() {
    static std::mutex m;
    return m;
  }
  std::lock_guard<std::mutex> lock_;
  std::string text_;
};

/// Elements alone: no comment, declaration or DOCTYPE that urdfdom's own parser, of 2011, may trip
/// over.
class ElementPrinter : public tinyxml2::XMLPrinter {
 public:
  using tinyxml2::XMLPrinter::Visit;
  bool Visit(const tinyxml2::XMLComment&) override { return true; }
  bool Visit(const tinyxml2::XMLDeclaration&) override { return true; }
  bool Visit(const tinyxml2::XMLUnknown&) override { return true; }
};

/// Only links and joints, and of them what moves: looks may be missing or wrong.
std::string without_looks(const XmlDocument& original) {
  XmlDocument document;
  original.DeepCopy(&document);
  XmlElement& robot = *document.RootElement();
  for_each_child(robot, nullptr, [&](XmlElement& e) {
    const std::string name = e.Name();
    if (name != "link" && name != "joint") return robot.DeleteChild(&e);
    remove_children(e, "visual");
    remove_children(e, "collision");
  });
  ElementPrinter printer;
  robot.Accept(&printer);
  return printer.CStr();
}

/// @throws ModelError also where urdfdom complains and goes on: it drops an inertia that it cannot
/// read
urdf::ModelInterfaceSharedPtr parse(const XmlDocument& document, const std::string& where) {
  std::string reason = "no reason given";
  try {
    CollectErrors errors;
    const urdf::ModelInterfaceSharedPtr urdf = urdf::parseURDF(without_looks(document));
    if (urdf && errors.text().empty()) return urdf;
    if (!errors.text().empty()) reason = errors.text();
  } catch (const std::exception& error) {
    reason = error.what();
  }
  throw ModelError(where + ": is not a valid URDF: " + reason);
}

/// A tree has one parent a link and no cycle; urdfdom overwrites the first parent without a word
/// and walks a cycle for ever.
void check_tree(XmlElement& robot, const std::string& where) {
  std::map<std::string, std::string> parent_of, joint_of;
  for (const char* element : {"link", "joint"}) {
    std::size_t count = 0;
    for_each_child(robot, element, [&](XmlElement&) { ++count; });
    require_few_links(count, where);
  }
  for_each_child(robot, "joint", [&](XmlElement& joint) {
    const std::string name = attribute(joint, "name");
    const XmlElement* parent = joint.FirstChildElement("parent");
    const XmlElement* child = joint.FirstChildElement("child");
    if (!parent || !child) return;  // urdfdom says it
    const std::string c = attribute(*child, "link");
    if (const auto it = joint_of.find(c); it != joint_of.end())
      throw ModelError(where + ": link '" + c + "' is the child of two joints, '" + it->second +
                       "' and '" + name + "'; a robot must be a tree");
    joint_of[c] = name;
    parent_of[c] = attribute(*parent, "link");
  });
  std::set<std::string> rooted;  // links below a root
  for (const auto& [child, unused] : parent_of) {
    std::vector<std::string> path;
    for (std::string at = child; parent_of.contains(at) && !rooted.contains(at);
         at = parent_of[at]) {
      path.push_back(at);
      if (path.size() > parent_of.size())
        throw ModelError(where + ": link '" + child +
                         "' is its own ancestor; a robot must be a tree");
    }
    rooted.insert(path.begin(), path.end());
  }
}

Pose<double> pose(const urdf::Pose& p) {
  double x = 0, y = 0, z = 0, w = 1;
  p.rotation.getQuaternion(x, y, z, w);
  return {rotation_from_quaternion(w, x, y, z), {p.position.x, p.position.y, p.position.z}};
}

SpatialInertia<double> inertia(const urdf::Inertial& i) {
  const Pose<double> X_LC = pose(i.origin);
  const Sym3<double> I_C{i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz};
  return inertia_from_com(i.mass, X_LC.p, rotate(X_LC.R, I_C));
}

/// Lets the robot float on a link of a floating joint: the root, which carries it alone, was the
/// world.
/// @param carrier  parent of the joint
/// @throws ModelError if the root is more than that, or the joint is not at it
void float_base(const urdf::Link& carrier, const std::string& where, Model& model,
                ModelLink& link) {
  const char* why = link.parent != 0                   ? "which is not the root"
                    : carrier.child_joints.size() != 1 ? "which carries other links, too"
                    : !is_zero(model.links[0].inertia) ? "which has a mass"
                                                       : nullptr;
  if (why)
    throw ModelError(where + ": joint '" + link.joint + "' is floating, on link '" + carrier.name +
                     "', " + why +
                     ": only a whole robot may float, on a root without mass; --fix-base "
                     "(fix_base=True) reads the joint as fixed where the file has it");
  model.links.clear();
  model.free_base = true;
  link.parent = -1;
}

void read_joint(const urdf::Joint& joint, const std::string& where, const ModelReading& reading,
                Model& model, ModelLink& link) {
  const std::string what = where + ": joint '" + joint.name + "'";
  link.joint = joint.name;
  link.X_PJ = pose(joint.parent_to_joint_origin_transform);
  if (joint.mimic && !reading.open_loops && joint.type != urdf::Joint::FIXED) {
    link.follows = Follow{joint.mimic->joint_name, joint.mimic->multiplier, joint.mimic->offset};
    link.passive = true;  // moved by the joint that it mimics
  } else if (joint.mimic && joint.type != urdf::Joint::FIXED) {
    model.notes.push_back("joint '" + joint.name + "' mimics '" + joint.mimic->joint_name +
                          "': a joint of its own here, as asked; the coupling's forces are missing "
                          "from the model");
  }
  switch (joint.type) {
    case urdf::Joint::FIXED:
      return;
    case urdf::Joint::REVOLUTE:
    case urdf::Joint::CONTINUOUS:
      link.type = ModelJoint::kRevolute;
      break;
    case urdf::Joint::PRISMATIC:
      link.type = ModelJoint::kPrismatic;
      break;
    case urdf::Joint::FLOATING:
      if (!reading.fix_base) return;  // float_base
      model.notes.push_back("joint '" + joint.name +
                            "' is floating: fixed where the file has it, as asked");
      return;
    case urdf::Joint::PLANAR:
      throw ModelError(
          what +
          " is planar: only joints of one degree of freedom are supported, and a floating base; "
          "types: revolute, continuous, prismatic, fixed, floating");
    default:
      throw ModelError(what + " has no known type");
  }
  const Vec3<double> axis{joint.axis.x, joint.axis.y, joint.axis.z};
  const double norm = std::sqrt(dot(axis, axis));
  if (!(norm > 1e-9)) throw ModelError(what + ": its axis is zero");
  link.axis = norm == 1.0 ? axis : axis * (1.0 / norm);
  if (joint.limits) {
    if (joint.type != urdf::Joint::CONTINUOUS) {
      link.limits.lower = joint.limits->lower;
      link.limits.upper = joint.limits->upper;
    }
    // 0 is what exporters write when they do not know.
    if (joint.limits->velocity > 0.0) link.limits.velocity = joint.limits->velocity;
    if (joint.limits->effort > 0.0) link.limits.effort = joint.limits->effort;
  }
  if (joint.dynamics) {
    JointTerms terms;
    terms.viscous = joint.dynamics->damping;
    terms.coulomb = joint.dynamics->friction;
    add_joint_terms(model, link, terms);
  }
}

}  // namespace

Model model_from_urdf(const std::string& text, const std::string& where,
                      const ModelReading& reading) {
  const std::unique_ptr<XmlDocument> document = parse_xml(text, where);
  XmlElement& robot = *document->RootElement();
  check_tree(robot, where);
  Model model;
  repair_urdf(robot, where, model.notes);
  const urdf::ModelInterfaceSharedPtr urdf = parse(*document, where);

  model.name = urdf->getName();
  model.source = where;
  // Joints in the order of the document: urdfdom sorts them by name.
  std::map<std::string, std::vector<std::string>> children;
  for_each_child(robot, "joint", [&](XmlElement& joint) {
    const urdf::JointConstSharedPtr j = urdf->getJoint(attribute(joint, "name"));
    if (j) children[j->parent_link_name].push_back(j->name);
  });
  struct Visit {
    std::string link;
    urdf::JointConstSharedPtr joint;
    int parent;
  };
  std::vector<Visit> stack{{urdf->getRoot()->name, nullptr, -1}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    const urdf::LinkConstSharedPtr source = urdf->getLink(visit.link);
    ModelLink link;
    link.name = source->name;
    link.parent = visit.parent;
    if (source->inertial) link.inertia = inertia(*source->inertial);
    if (visit.joint) read_joint(*visit.joint, where, reading, model, link);
    if (visit.joint && visit.joint->type == urdf::Joint::FLOATING && !reading.fix_base)
      float_base(*urdf->getLink(visit.joint->parent_link_name), where, model, link);
    const int index = static_cast<int>(model.links.size());
    model.links.push_back(link);
    const std::vector<std::string>& below = children[visit.link];
    for (auto it = below.rbegin(); it != below.rend(); ++it) {
      const urdf::JointConstSharedPtr j = urdf->getJoint(*it);
      stack.push_back({j->child_link_name, j, index});
    }
  }
  if (reading.free_base) let_base_float(model, where);
  validate(model, where);
  start_from_geometry(model);
  return model;
}

std::string urdf_with_values(const std::string& original, const std::string& where,
                             const Model& model, std::vector<std::string>& notes) {
  const Model before = model_from_urdf(
      original, where,
      {.fix_base = !model.free_base, .free_base = model.free_base, .open_loops = true});
  const std::unique_ptr<XmlDocument> document = parse_xml(original, where);
  XmlElement& robot = *document->RootElement();
  std::map<std::string, XmlElement*> links, joints;
  for_each_child(robot, "link", [&](XmlElement& e) { links[attribute(e, "name")] = &e; });
  for_each_child(robot, "joint", [&](XmlElement& e) { joints[attribute(e, "name")] = &e; });

  const auto locked = [&](std::size_t i) {  // a joint that was made fixed since
    return model.links[i].type == ModelJoint::kFixed && before.links[i].type != ModelJoint::kFixed;
  };
  for (std::size_t i = 0; i < std::max(model.links.size(), before.links.size()); ++i)
    if (i >= model.links.size() || i >= before.links.size() ||
        model.links[i].name != before.links[i].name ||
        model.links[i].joint != before.links[i].joint ||
        (model.links[i].type != before.links[i].type && !locked(i)))
      throw ModelError(where + ": its links are not those of the model '" + model.name +
                       "'; write the model as .json");
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const ModelLink &now = model.links[i], &then = before.links[i];
    if (!same(now.inertia, then.inertia)) write_urdf_inertial(*links.at(now.name), now.inertia);
    if (now.joint.empty()) {
      if (!same(now.X_PJ, then.X_PJ))
        notes.push_back("the pose of the root link '" + now.name + "'");
      continue;
    }
    XmlElement& joint = *joints.at(now.joint);
    if (!same(now.X_PJ, then.X_PJ)) set_xyz_rpy(child(joint, "origin"), now.X_PJ);
    if (locked(i)) {
      joint.SetAttribute("type", "fixed");
      for (const char* moving : {"axis", "limit", "dynamics", "mimic", "safety_controller"})
        remove_children(joint, moving);
    }
    if (now.type == ModelJoint::kFixed) continue;
    if (now.axis.x != then.axis.x || now.axis.y != then.axis.y || now.axis.z != then.axis.z)
      child(joint, "axis").SetAttribute("xyz", exact(now.axis).c_str());
    const JointTerms a = joint_terms(model, now.joint), b = joint_terms(before, now.joint);
    if (a.viscous != b.viscous) set_number(child(joint, "dynamics"), "damping", a.viscous);
    if (a.coulomb != b.coulomb) set_number(child(joint, "dynamics"), "friction", a.coulomb);
    if (a.armature != 0.0) notes.push_back("armature at " + now.joint + " = " + exact(a.armature));
    if (a.stiffness != 0.0) notes.push_back("joint_spring at " + now.joint);
    const auto limit = [&](const char* name, double x, double y) {
      if (x == y) return;
      if (std::isfinite(x))
        set_number(child(joint, "limit"), name, x);
      else if (XmlElement* e = joint.FirstChildElement("limit"))
        e->SetAttribute(name, "0");
    };
    limit("lower", now.limits.lower, then.limits.lower);
    limit("upper", now.limits.upper, then.limits.upper);
    limit("velocity", now.limits.velocity, then.limits.velocity);
    limit("effort", now.limits.effort, then.limits.effort);
    if (now.passive && !now.follows) notes.push_back("joint '" + now.joint + "' is passive");
  }
  if (model.free_base && model.links[0].joint.empty())
    notes.push_back("that base '" + model.links[0].name +
                    "' floats: --free-base (free_base=True) reads it so");
  for (const EffectSpec& e : model.effects)
    if (!is_joint_term(model, e)) notes.push_back(e.effect + " at " + e.where);
  for (const ConstraintSpec& c : model.constraints)
    notes.push_back("constraint '" + c.name + "': a URDF is a tree");
  for (const ModelFrame& f : model.frames) notes.push_back("frame '" + f.name + "'");
  const Vec3<double> g = model.gravity - before.gravity;
  if (dot(g, g) != 0.0) notes.push_back("gravity " + exact(model.gravity));
  if (model.ball) notes.push_back("the ball");
  if (model.posterior) notes.push_back("the posterior of the parameters");
  return xml_text(*document);
}

}  // namespace diffnea::io
