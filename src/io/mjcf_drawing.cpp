#include "io/mjcf_drawing.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include <Eigen/Geometry>

#include "io/mjcf_inertial.hpp"
#include "io/mjcf_joint.hpp"
#include "io/mjcf_loops.hpp"
#include "io/mjcf_servo.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// MuJoCo moves no body below 1e-15 (mjMINVAL); its dynamics do not see this.
constexpr double kLeastMass = 1e-12;    // [kg]
constexpr double kLeastMoment = 1e-14;  // [kg·m²]

void set(XmlElement& element, const char* name, double value) {
  element.SetAttribute(name, exact(value).c_str());
}

void set_pose(XmlElement& element, const Pose<double>& X) {
  const Eigen::Quaterniond q(to_eigen(X.R));
  element.SetAttribute("pos", exact(X.p).c_str());
  element.SetAttribute("quat", (exact(q.w()) + " " + exact(vec3<double>(q.vec()))).c_str());
}

/// Poses of the links in the world where every joint's number is 0.
std::vector<Pose<double>> link_poses_at_zero(const Model& model) {
  std::vector<Pose<double>> out;
  for (const ModelLink& link : model.links)
    out.push_back(link.parent < 0 ? link.X_PJ
                                  : out[static_cast<std::size_t>(link.parent)] * link.X_PJ);
  return out;
}

class MjcfDrawing {
 public:
  MjcfDrawing(const Model& model, const std::vector<ServoActuator>& servos,
              std::vector<std::string>& notes)
      : model_(model), servos_(servos), notes_(notes) {}

  std::string text() {
    XmlElement* root = document_.NewElement("mujoco");
    document_.InsertEndChild(root);
    root->SetAttribute("model", model_.name.empty() ? "robot" : model_.name.c_str());
    child(*root, "compiler").SetAttribute("angle", "radian");
    child(*root, "option").SetAttribute("gravity", exact(model_.gravity).c_str());
    world_ = &child(*root, "worldbody");
    for (const ModelLink& link : model_.links) draw_link(link);
    for (const ModelFrame& frame : model_.frames) draw_frame(frame);
    for (const CapsuleSpec& obstacle : model_.obstacles) draw_obstacle(obstacle);
    if (model_.ball) draw_ball(*root);
    draw_couplings(*root);
    draw_constraints(*root);
    draw_motors(*root);
    write_servos(*root, servos_);
    if (model_.cup) draw_cup(*root);
    if (!model_.home.empty()) draw_home(*root);
    note_the_rest();
    return xml_text(document_);
  }

 private:
  XmlElement& body(int link) { return link < 0 ? *world_ : *bodies_[link]; }

  /// MuJoCo counts the mass of bodies that are fixed to a moving one, but no further down.
  bool has_mass(std::size_t link) const {
    if (!is_zero(model_.links[link].inertia)) return true;
    return std::ranges::any_of(model_.links, [&](const ModelLink& other) {
      return other.parent == static_cast<int>(link) && other.type == ModelJoint::kFixed &&
             !is_zero(other.inertia);
    });
  }

  void draw_link(const ModelLink& link) {
    const bool is_world = link.name == "world";  // MuJoCo's name of what everything stands on
    const bool floats = model_.free_base && link.parent < 0;
    if (is_world && link.type == ModelJoint::kFixed && link.parent < 0 && !floats &&
        same(link.X_PJ, Pose<double>::identity())) {
      bodies_.push_back(world_);
      return;
    }
    if (is_world) notes_.emplace_back("the name of link 'world' (written as 'world_')");
    XmlElement& e = *body(link.parent).InsertNewChildElement("body");
    e.SetAttribute("name", is_world ? "world_" : link.name.c_str());
    set_pose(e, link.X_PJ);
    bodies_.push_back(&e);
    if ((link.type != ModelJoint::kFixed || floats) && !has_mass(bodies_.size() - 1)) {
      write_mjcf_inertial(e, inertia_from_com<double>(kLeastMass, {}, {}), kLeastMoment);
      notes_.push_back("that link '" + link.name + "' has no inertia (written as " +
                       exact(kLeastMass) + " kg)");
    } else {
      write_mjcf_inertial(e, link.inertia, kLeastMoment);
    }
    if (link.type != ModelJoint::kFixed) draw_joint(e, link);
    if (!floats) return;
    XmlElement& joint = *e.InsertNewChildElement("freejoint");
    if (!link.joint.empty()) joint.SetAttribute("name", link.joint.c_str());
  }

  void draw_joint(XmlElement& e, const ModelLink& link) {
    XmlElement& joint = *e.InsertNewChildElement("joint");
    joint.SetAttribute("name", link.joint.c_str());
    joint.SetAttribute("type", link.type == ModelJoint::kRevolute ? "hinge" : "slide");
    joint.SetAttribute("axis", exact(link.axis).c_str());
    write_mjcf_range(joint, link, 1.0, notes_);
    if (std::isfinite(link.limits.velocity))
      notes_.push_back("the velocity limit of '" + link.joint + "'");
    const JointTerms terms = joint_terms(model_, link.joint);
    if (terms.viscous != 0.0) set(joint, "damping", terms.viscous);
    if (terms.coulomb != 0.0) set(joint, "frictionloss", terms.coulomb);
    if (terms.armature != 0.0) set(joint, "armature", terms.armature);
    if (terms.stiffness != 0.0) {
      set(joint, "stiffness", terms.stiffness);
      set(joint, "springref", terms.rest);
    }
  }

  void draw_frame(const ModelFrame& frame) {
    XmlElement& site = *body(frame.link).InsertNewChildElement("site");
    site.SetAttribute("name", frame.name.c_str());
    set_pose(site, frame.X_LF);
  }

  /// Without mass, and hit by the ball alone.
  void draw_obstacle(const CapsuleSpec& o) {
    XmlElement& geom = *body(o.link).InsertNewChildElement("geom");
    const Vec3<double> d = o.p_LB - o.p_LA;
    const bool sphere = dot(d, d) == 0.0;
    geom.SetAttribute("type", sphere ? "sphere" : "capsule");
    if (sphere)
      geom.SetAttribute("pos", exact(o.p_LA).c_str());
    else
      geom.SetAttribute("fromto", (exact(o.p_LA) + " " + exact(o.p_LB)).c_str());
    set(geom, "size", o.radius);
    geom.SetAttribute("mass", "0");
    geom.SetAttribute("contype", "0");
    geom.SetAttribute("conaffinity", "1");
  }

  void draw_ball(XmlElement& root) {
    const BallSpec& ball = *model_.ball;
    XmlElement& e = *world_->InsertNewChildElement("body");
    e.SetAttribute("name", "ball");
    const double I = 0.4 * ball.mass * ball.radius * ball.radius;  // of a homogeneous ball
    write_mjcf_inertial(e, inertia_from_com<double>(ball.mass, {}, {I, 0, 0, I, 0, I}),
                        kLeastMoment);
    e.InsertNewChildElement("freejoint");
    if (ball.radius > 0.0) {
      XmlElement& geom = *e.InsertNewChildElement("geom");
      geom.SetAttribute("type", "sphere");
      set(geom, "size", ball.radius);
      geom.SetAttribute("contype", "1");
      geom.SetAttribute("conaffinity", "0");
    }
    if (ball.string) draw_string(root, e, *ball.string);
  }

  void draw_string(XmlElement& root, XmlElement& ball, const StringSpec& string) {
    std::set<std::string> names;
    std::string anchor;
    for (const ModelFrame& f : model_.frames) {
      names.insert(f.name);
      const Vec3<double> d = f.X_LF.p - string.p_LS;
      if (f.link == string.link && dot(d, d) == 0.0 && anchor.empty()) anchor = f.name;
    }
    const auto unused = [&](std::string name) {
      while (!names.insert(name).second) name += "_";
      return name;
    };
    if (anchor.empty()) {
      anchor = unused("string");
      XmlElement& site = *body(string.link).InsertNewChildElement("site");
      site.SetAttribute("name", anchor.c_str());
      site.SetAttribute("pos", exact(string.p_LS).c_str());
    }
    const std::string knot = unused("ball");
    ball.InsertNewChildElement("site")->SetAttribute("name", knot.c_str());
    XmlElement& tendon = child(child(root, "tendon"), "spatial");
    tendon.SetAttribute("name", "string");
    tendon.SetAttribute("limited", "true");
    tendon.SetAttribute("range", ("0 " + exact(string.length)).c_str());
    for (const std::string& site : {anchor, knot})
      tendon.InsertNewChildElement("site")->SetAttribute("site", site.c_str());
    if (string.length_std > 0.0) notes_.emplace_back("the uncertainty of the string's length");
  }

  /// Where there are motors, joints without one are passive.
  void draw_motors(XmlElement& root) {
    const bool any = std::ranges::any_of(model_.links, [](const ModelLink& link) {
      return link.type != ModelJoint::kFixed && !link.passive;
    });
    for (const ModelLink& link : model_.links) {
      if (link.type == ModelJoint::kFixed) continue;
      if (link.passive) {
        if (!any && !link.follows)
          notes_.push_back("whether joint '" + link.joint + "' is passive");
        continue;
      }
      if (std::ranges::find(servos_, link.joint, &ServoActuator::joint) != servos_.end()) continue;
      XmlElement& motor = *child(root, "actuator").InsertNewChildElement("motor");
      motor.SetAttribute("name", link.joint.c_str());
      motor.SetAttribute("joint", link.joint.c_str());
      if (link.limits.effort == 0.0)  // no range of MuJoCo's is empty
        notes_.push_back("the effort limit of '" + link.joint + "', which is 0");
      if (!std::isfinite(link.limits.effort) || link.limits.effort == 0.0) continue;
      motor.SetAttribute("ctrllimited", "true");
      motor.SetAttribute("ctrlrange",
                         (exact(-link.limits.effort) + " " + exact(link.limits.effort)).c_str());
    }
  }

  /// Joints that follow others.
  void draw_couplings(XmlElement& root) {
    for (const ModelLink& link : model_.links) {
      if (!link.follows) continue;
      XmlElement& e = *child(root, "equality").InsertNewChildElement("joint");
      e.SetAttribute("joint1", link.joint.c_str());
      e.SetAttribute("joint2", link.follows->leader.c_str());
      e.SetAttribute(
          "polycoef",
          (exact(link.follows->offset) + " " + exact(link.follows->ratio) + " 0 0 0").c_str());
    }
  }

  /// Constraints between bodies where these coincide at q = 0, as MuJoCo has them, else between
  /// sites.
  void draw_constraints(XmlElement& root) {
    constexpr double kTogether = 1e-12;  // [m]
    const std::vector<Pose<double>> at = link_poses_at_zero(model_);
    const auto in_world = [&](const ConstraintEnd& end) {
      return end.link < 0 ? end.X_LF : at[static_cast<std::size_t>(end.link)] * end.X_LF;
    };
    for (const ConstraintSpec& c : model_.constraints) {
      const Pose<double> J = in_world(c.first), K = in_world(c.second);
      const Vec3<double> apart = J.p - K.p, turned = J.R.col[2] - K.R.col[2];
      const bool together =
          dot(apart, apart) < kTogether * kTogether &&
          (c.kind != ConstraintKind::kHinge || dot(turned, turned) < kTogether * kTogether);
      if (!write_constraint(root, c, bodies_, !together))
        notes_.push_back("constraint '" + c.name + "', a wheel that rolls");
      if (c.kind == ConstraintKind::kHinge)
        notes_.push_back("that constraint '" + c.name +
                         "' is a hinge (written as two points of its axis)");
    }
  }

  void draw_cup(XmlElement& root) {
    XmlElement& numeric = child(child(root, "custom"), "numeric");
    numeric.SetAttribute("name", "cup");
    const CupSpec& c = *model_.cup;
    numeric.SetAttribute("data", (exact(c.inner_radius) + " " + exact(c.wall) + " " +
                                  exact(c.floor) + " " + exact(c.rim))
                                     .c_str());
  }

  /// Joints in the order of the document, which goes down each branch before it takes the next; the
  /// ball, where there is one, comes last.
  void draw_home(XmlElement& root) {
    std::vector<std::optional<double>> at(model_.links.size());
    const std::vector<int> moving = tree_links(model_);
    for (const TreeJoint& j : tree_joints(model_))
      at[moving[j.link]] = j.drive.ratio * model_.home[j.drive.dof] + j.drive.offset;
    std::string qpos;
    if (model_.free_base) {
      const Pose<double>& X = model_.links[0].X_PJ;
      const Eigen::Quaterniond turn(to_eigen(X.R));
      qpos = exact(X.p) + " " + exact(turn.w()) + " " + exact(vec3<double>(turn.vec()));
    }
    const auto visit = [&](const auto& self, int parent) -> void {
      for (std::size_t i = 0; i < model_.links.size(); ++i) {
        if (model_.links[i].parent != parent) continue;
        if (at[i]) qpos += (qpos.empty() ? "" : " ") + exact(*at[i]);
        self(self, static_cast<int>(i));
      }
    };
    visit(visit, -1);
    if (model_.ball) qpos += " 0 0 0 1 0 0 0";  // MuJoCo takes a space at the end for a number
    XmlElement& key = child(child(root, "keyframe"), "key");
    key.SetAttribute("name", "home");
    key.SetAttribute("qpos", qpos.c_str());
  }

  void note_the_rest() {
    for (const EffectSpec& e : model_.effects)
      if (!is_joint_term(model_, e)) notes_.push_back(e.effect + " at " + e.where);
    if (model_.posterior) notes_.emplace_back("the posterior of the parameters");
  }

  const Model& model_;
  const std::vector<ServoActuator>& servos_;
  std::vector<std::string>& notes_;
  XmlDocument document_;
  XmlElement* world_ = nullptr;
  std::vector<XmlElement*> bodies_;  ///< per model link
};

}  // namespace

std::string draw_mjcf(const Model& model, bool delays, std::vector<std::string>& notes) {
  Model native = model;
  std::vector<ServoActuator> servos = take_servos(native, delays, notes);
  add_file_servos(native, servos);
  return MjcfDrawing(native, servos, notes).text();
}

}  // namespace diffnea::io
