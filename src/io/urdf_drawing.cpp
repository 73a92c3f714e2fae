#include "io/urdf_drawing.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "io/model_parts.hpp"
#include "io/urdf_elements.hpp"

namespace diffnea::io {
namespace {

/// A limit that a joint does not reach, where the format must have one [rad, m].
constexpr double kFarAway = 1e6;

class UrdfDrawing {
 public:
  UrdfDrawing(const Model& model, std::vector<std::string>& notes) : model_(model), notes_(notes) {
    for (const ModelLink& link : model.links) {
      links_.insert(link.name);
      if (!link.joint.empty()) joints_.insert(link.joint);
    }
  }

  std::string text() {
    robot_ = document_.NewElement("robot");
    document_.InsertEndChild(document_.NewDeclaration());
    document_.InsertEndChild(robot_);
    robot_->SetAttribute("name", model_.name.empty() ? "robot" : model_.name.c_str());
    if (needs_world()) {
      world_ = unused(links_, "world");
      add_link(world_);
    }
    for (const ModelLink& link : model_.links) draw_link(link);
    for (const ModelFrame& frame : model_.frames) draw_frame(frame);
    note_the_rest();
    return xml_text(document_);
  }

 private:
  /// A URDF has one root, which stands at the origin.
  bool needs_world() const {
    int roots = 0;
    bool elsewhere = std::ranges::any_of(model_.frames, [](const auto& f) { return f.link < 0; });
    for (const ModelLink& link : model_.links)
      if (link.parent < 0) {
        ++roots;
        elsewhere |= model_.free_base || link.type != ModelJoint::kFixed ||
                     !same(link.X_PJ, Pose<double>::identity());
      }
    return roots != 1 || elsewhere;
  }

  static std::string unused(std::set<std::string>& taken, const std::string& wish) {
    std::string name = wish;
    for (int k = 2; !taken.insert(name).second; ++k) name = wish + "_" + std::to_string(k);
    return name;
  }

  std::string name_of(int link) const { return link < 0 ? world_ : model_.links[link].name; }

  XmlElement& add_link(const std::string& name) {
    XmlElement& link = *robot_->InsertNewChildElement("link");
    link.SetAttribute("name", name.c_str());
    return link;
  }

  XmlElement& add_joint(const std::string& name, const char* type, const std::string& parent,
                        const std::string& child_link, const Pose<double>& X_PJ) {
    XmlElement& joint = *robot_->InsertNewChildElement("joint");
    joint.SetAttribute("name", name.c_str());
    joint.SetAttribute("type", type);
    child(joint, "parent").SetAttribute("link", parent.c_str());
    child(joint, "child").SetAttribute("link", child_link.c_str());
    set_xyz_rpy(child(joint, "origin"), X_PJ);
    return joint;
  }

  void draw_link(const ModelLink& link) {
    write_urdf_inertial(add_link(link.name), link.inertia);
    if (link.parent < 0 && world_.empty()) return;  // the root
    if (link.type == ModelJoint::kFixed) {
      const bool floats = model_.free_base && link.parent < 0;
      const std::string name = link.joint.empty()
                                   ? unused(joints_, link.name + (floats ? "_floating" : "_mount"))
                                   : link.joint;
      add_joint(name, floats ? "floating" : "fixed", name_of(link.parent), link.name, link.X_PJ);
      return;
    }
    const JointLimits& limits = link.limits;
    const bool turns = link.type == ModelJoint::kRevolute,
               limited = std::isfinite(limits.lower) || std::isfinite(limits.upper);
    XmlElement& joint = add_joint(link.joint,
                                  !turns    ? "prismatic"
                                  : limited ? "revolute"
                                            : "continuous",
                                  name_of(link.parent), link.name, link.X_PJ);
    child(joint, "axis").SetAttribute("xyz", exact(link.axis).c_str());
    draw_limits(joint, link, turns && !limited);
    const JointTerms terms = joint_terms(model_, link.joint);
    if (terms.viscous != 0.0) set_number(child(joint, "dynamics"), "damping", terms.viscous);
    if (terms.coulomb != 0.0) set_number(child(joint, "dynamics"), "friction", terms.coulomb);
    if (terms.armature != 0.0)
      notes_.push_back("armature at " + link.joint + " = " + exact(terms.armature));
    if (terms.stiffness != 0.0) notes_.push_back("joint_spring at " + link.joint);
    if (link.follows) {
      XmlElement& mimic = child(joint, "mimic");
      mimic.SetAttribute("joint", link.follows->leader.c_str());
      set_number(mimic, "multiplier", link.follows->ratio);
      set_number(mimic, "offset", link.follows->offset);
    }
    if (link.passive && !link.follows) notes_.push_back("joint '" + link.joint + "' is passive");
  }

  /// 0 for effort and velocity: not known, as exporters write it.
  void draw_limits(XmlElement& joint, const ModelLink& link, bool continuous) {
    const JointLimits& x = link.limits;
    const bool drives = std::isfinite(x.velocity) || std::isfinite(x.effort);
    if (continuous && !drives) return;
    XmlElement& limit = child(joint, "limit");
    if (!continuous) {
      set_number(limit, "lower", std::isfinite(x.lower) ? x.lower : -kFarAway);
      set_number(limit, "upper", std::isfinite(x.upper) ? x.upper : kFarAway);
      if (!std::isfinite(x.lower) || !std::isfinite(x.upper))
        notes_.push_back("that '" + link.joint + "' has no limit to a side (written as " +
                         exact(kFarAway) + ")");
    }
    set_number(limit, "effort", std::isfinite(x.effort) ? x.effort : 0.0);
    set_number(limit, "velocity", std::isfinite(x.velocity) ? x.velocity : 0.0);
  }

  void draw_frame(const ModelFrame& frame) {
    if (!links_.insert(frame.name).second) {
      notes_.push_back("frame '" + frame.name + "', whose name a link has");
      return;
    }
    if (model_.free_base && frame.link < 0) {  // the base is the only child of the root
      notes_.push_back("frame '" + frame.name + "', which stands in the world");
      return;
    }
    add_link(frame.name);
    add_joint(unused(joints_, frame.name + "_mount"), "fixed", name_of(frame.link), frame.name,
              frame.X_LF);
  }

  void note_the_rest() {
    for (const EffectSpec& e : model_.effects)
      if (!is_joint_term(model_, e)) notes_.push_back(e.effect + " at " + e.where);
    for (const ConstraintSpec& c : model_.constraints)
      notes_.push_back("constraint '" + c.name + "': a URDF is a tree");
    const Vec3<double> g = model_.gravity - Model{}.gravity;
    if (dot(g, g) != 0.0) notes_.push_back("gravity " + exact(model_.gravity));
    if (model_.ball) notes_.emplace_back("the ball");
    if (model_.cup) notes_.emplace_back("the cup's dimensions");
    if (!model_.obstacles.empty()) notes_.emplace_back("the obstacles of the ball");
    if (!model_.home.empty()) notes_.emplace_back("the posture 'home'");
    if (model_.posterior) notes_.emplace_back("the posterior of the parameters");
  }

  const Model& model_;
  std::vector<std::string>& notes_;
  XmlDocument document_;
  XmlElement* robot_ = nullptr;
  std::string world_;  ///< empty: the model has a root of its own
  std::set<std::string> links_, joints_;
};

}  // namespace

std::string draw_urdf(const Model& model, std::vector<std::string>& notes) {
  return UrdfDrawing(model, notes).text();
}

}  // namespace diffnea::io
