/// Values of a model into the MJCF that it was read from.

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_ball.hpp"
#include "io/mjcf_inertial.hpp"
#include "io/mjcf_joint.hpp"
#include "io/mjcf_parts.hpp"
#include "io/mjcf_readback.hpp"
#include "io/mjcf_servo.hpp"
#include "io/mjcf_translate.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Elements of bodies and joints in the order of MuJoCo's numbers.
struct Elements {
  std::vector<XmlElement*> bodies{nullptr};  ///< 0 is the world
  std::vector<XmlElement*> joints;

  /// A body's own joints come before those of the bodies in it, wherever they stand. A <frame>
  /// is no body.
  void add_joints_of(XmlElement& body, bool fix_base) {
    for_each_child(body, nullptr, [&](XmlElement& e) {
      if ((is(e, "joint") || is(e, "freejoint")) && !(fix_base && is_free_base(e)))
        joints.push_back(&e);
      if (is(e, "frame")) add_joints_of(e, fix_base);
    });
  }
};
Elements find_elements(XmlElement& root, const mjModel& m, const Mjcf& mjcf) {
  Elements out;
  for_each_child(root, "worldbody", [&](XmlElement& world) {
    walk(world, [&](XmlElement& e) {
      if (!is(e, "body")) return;
      out.bodies.push_back(&e);
      out.add_joints_of(e, mjcf.reading.fix_base);
    });
  });
  const auto named = [](const XmlElement& e, const std::string& name) {
    return attribute(e, "name").empty() || attribute(e, "name") == name;
  };
  bool ok = out.bodies.size() == static_cast<std::size_t>(m.nbody) &&
            out.joints.size() == static_cast<std::size_t>(m.njnt);
  for (int b = 1; ok && b < m.nbody; ++b) ok = named(*out.bodies[b], body_name(m, b));
  for (int j = 0; ok && j < m.njnt; ++j) ok = named(*out.joints[j], joint_name(m, j));
  if (!ok)
    throw ModelError(
        mjcf.where +
        ": its bodies are generated (composite, replicate): values cannot be written in "
        "place; write the model as .json");
  return out;
}

/// The ball of `now` where it differs from `then`, which was read from the document.
/// @param written  gains what was put into the document
void write_ball(XmlElement& root, const Elements& elements, const mjModel& m,
                const std::string& where, const Model& now, const Model& then, Model& written,
                std::vector<bool>& states_inertia, std::vector<std::string>& notes) {
  if (now.ball.has_value() != then.ball.has_value()) {
    notes.emplace_back(now.ball ? "the ball" : "that there is no ball");
    return;
  }
  if (!now.ball) return;
  std::vector<std::string> said_when_read;
  const MjcfBall parts = *find_ball(m, where, said_when_read);
  written.ball = write_string(root, m, parts, *now.ball, *then.ball, notes);
  if (now.ball->radius != then.ball->radius) notes.emplace_back("the changed radius of the ball");
  if (now.ball->mass == then.ball->mass) return;
  Theta<double> theta = body_inertia(m, parts.body).theta();
  const double ratio = now.ball->mass / theta[0];  // of equal shape
  for (double& x : theta) x *= ratio;
  theta[0] = now.ball->mass;
  write_mjcf_inertial(*elements.bodies[parts.body], SpatialInertia<double>::from_theta(theta));
  written.ball->mass = now.ball->mass;
  states_inertia[static_cast<std::size_t>(parts.body)] = true;
}

bool same_surroundings(const Model& a, const Model& b) {
  const auto same_cup = [](const CupSpec& x, const CupSpec& y) {
    return x.inner_radius == y.inner_radius && x.wall == y.wall && x.floor == y.floor &&
           x.rim == y.rim;
  };
  const auto same_obstacle = [](const CapsuleSpec& x, const CapsuleSpec& y) {
    const Vec3<double> A = x.p_LA - y.p_LA, B = x.p_LB - y.p_LB;
    return x.link == y.link && x.radius == y.radius && dot(A, A) == 0.0 && dot(B, B) == 0.0;
  };
  return a.cup.has_value() == b.cup.has_value() && (!a.cup || same_cup(*a.cup, *b.cup)) &&
         std::ranges::equal(a.obstacles, b.obstacles, same_obstacle);
}

bool same_constraints(const Model& a, const Model& b) {
  return std::ranges::equal(
      a.constraints, b.constraints, [](const ConstraintSpec& x, const ConstraintSpec& y) {
        return x.kind == y.kind && x.radius == y.radius && x.first.link == y.first.link &&
               x.second.link == y.second.link && same(x.first.X_LF, y.first.X_LF) &&
               same(x.second.X_LF, y.second.X_LF);
      });
}

/// Takes out what would overrule the inertias written here.
/// @return whether there was any: bodies whose inertia is not stated, as compiled, change then
bool trust_stated_inertias(XmlElement& root) {
  bool overruled = false;
  for_each_child(root, "compiler", [&](XmlElement& c) {
    for (const char* name : {"balanceinertia", "boundmass", "boundinertia", "settotalmass"}) {
      overruled |= c.Attribute(name) != nullptr;
      c.DeleteAttribute(name);
    }
    if (attribute(c, "inertiafromgeom") != "true") return;
    overruled = true;
    c.SetAttribute("inertiafromgeom", "auto");
  });
  return overruled;
}

/// Positions written here are those in the parent, whichever the document states.
void refuse_global_coordinates(XmlElement& root, const std::string& where) {
  for_each_child(root, "compiler", [&](XmlElement& c) {
    if (attribute(c, "coordinate") == "global")
      throw ModelError(where +
                       ": its positions are in global coordinates (<compiler "
                       "coordinate=\"global\"/>): values cannot be written in place; write the "
                       "model as .json");
  });
}

/// Whether some joint's stiffness and damping follow from a time constant and the inertia at hand,
/// whatever they are stated as.
bool has_spring_dampers(XmlElement& root) {
  bool found = false;
  walk(root, [&](XmlElement& e) { found |= e.Attribute("springdamper") != nullptr; });
  return found;
}

bool angles_in_degrees(XmlElement& root) {
  bool degrees = true;
  for_each_child(root, "compiler", [&](XmlElement& c) {
    if (c.Attribute("angle")) degrees = attribute(c, "angle") == "degree";
  });
  return degrees;
}

/// @param state_springs  stiffness and damping are stated even if they did not change
void write_joint(XmlElement& e, const ModelLink& now, const ModelLink& then, const JointTerms& a,
                 const JointTerms& b, bool degrees, bool state_springs,
                 std::vector<std::string>& notes) {
  const double angle = degrees && now.type == ModelJoint::kRevolute ? 180.0 / M_PI : 1.0;
  const auto set = [&](const char* name, double x, double y, double unit = 1.0) {
    if (x != y) e.SetAttribute(name, exact(x * unit).c_str());
  };
  set("damping", a.viscous, b.viscous);
  set("frictionloss", a.coulomb, b.coulomb);
  set("armature", a.armature, b.armature);
  set("stiffness", a.stiffness, b.stiffness);
  if (state_springs) {
    e.SetAttribute("springdamper", "0 0");
    e.SetAttribute("damping", exact(a.viscous).c_str());
    e.SetAttribute("stiffness", exact(a.stiffness).c_str());
  }
  if (a.stiffness != 0.0) set("springref", a.rest, b.rest, angle);
  if (now.limits.lower != then.limits.lower || now.limits.upper != then.limits.upper)
    write_mjcf_range(e, now, angle, notes);
}

}  // namespace

std::string mjcf_with_values(const Mjcf& mjcf, const Model& with_servos, bool delays,
                             std::vector<std::string>& notes) {
  Model model = with_servos;
  const std::vector<ServoActuator> servos = take_servos(model, delays, notes);
  const std::string& where = mjcf.where;
  const MujocoModel m = compile_mjcf(mjcf);
  const Model before = model_from_mujoco(*m, mjcf);
  XmlElement& root = *mjcf.document->RootElement();
  refuse_global_coordinates(root, where);
  const Elements elements = find_elements(root, *m, mjcf);
  const bool degrees = angles_in_degrees(root), state_springs = has_spring_dampers(root);

  const auto alike = [](const ModelLink& a, const ModelLink& b) {
    return a.name == b.name && a.joint == b.joint && a.type == b.type;
  };
  if (!std::ranges::equal(model.links, before.links, alike))
    throw ModelError(where + ": its links are not those of the model '" + model.name +
                     "'; write the model as .json");

  Model written = model;  // what the document is to say: what it cannot is as before
  written.ball = before.ball;
  int link = 0;
  std::vector<bool> states_inertia(static_cast<std::size_t>(m->nbody));
  write_ball(root, elements, *m, where, model, before, written, states_inertia, notes);
  const std::vector<bool> left_out = left_out_bodies(*m, mjcf);
  for (int b = 1; b < m->nbody; ++b) {
    if (left_out[b]) continue;
    for (int k = 0; k < std::max(1, m->body_jntnum[b]); ++k, ++link) {
      const ModelLink &now = model.links[link], &then = before.links[link];
      const bool last = k + 1 >= m->body_jntnum[b];
      if (!same(now.inertia, then.inertia)) {
        if (last) {  // the link's origin is the joint's anchor, the body's is where the file has it
          const Vec3<double> p =
              m->body_jntnum[b] ? vec(m->jnt_pos + 3 * (m->body_jntadr[b] + k)) : Vec3<double>{};
          write_mjcf_inertial(*elements.bodies[b], to_parent(shift(p), now.inertia));
          states_inertia[b] = true;
        } else {
          notes.push_back("inertia of '" + now.name + "', a link without a body of its own");
          written.links[link].inertia = then.inertia;
        }
      }
      if (!same(now.X_PJ, then.X_PJ)) notes.push_back("the changed pose of '" + now.name + "'");
      written.links[link].X_PJ = then.X_PJ;
      if (m->body_jntnum[b] == 0 || is_free(*m, b)) continue;
      XmlElement& joint = *elements.joints[m->body_jntadr[b] + k];
      write_joint(joint, now, then, joint_terms(model, now.joint), joint_terms(before, now.joint),
                  degrees, state_springs, notes);
      if (now.passive != then.passive)
        notes.push_back("whether joint '" + now.joint + "' is passive");
      if (now.limits.effort != then.limits.effort &&  // a servo has its own
          std::ranges::find(servos, now.joint, &ServoActuator::joint) == servos.end())
        notes.push_back("the effort limit of '" + now.joint + "'");
      if (now.limits.velocity != then.limits.velocity)
        notes.push_back("the velocity limit of '" + now.joint + "'");
    }
  }
  if (std::ranges::find(states_inertia, true) != states_inertia.end() &&
      trust_stated_inertias(root)) {
    for (int b = 1; b < m->nbody; ++b)
      if (!states_inertia[b]) write_mjcf_inertial(*elements.bodies[b], body_inertia(*m, b));
  }
  const Vec3<double> g = model.gravity - before.gravity;
  if (dot(g, g) != 0.0) child(root, "option").SetAttribute("gravity", exact(model.gravity).c_str());
  if (!same_surroundings(model, before))
    notes.emplace_back("the changed cup or obstacles of the ball");
  if (!same_constraints(model, before)) notes.emplace_back("the changed constraints");
  for (const EffectSpec& e : model.effects)
    if (!is_joint_term(model, e)) notes.push_back(e.effect + " at " + e.where);
  if (model.posterior) notes.emplace_back("the posterior of the parameters");
  write_servos(root, servos);
  require_it_says(*compile_mjcf(mjcf), written, mjcf);
  return xml_text(*mjcf.document);
}

std::string self_contained_mjcf(const Mjcf& mjcf) {
  const std::unique_ptr<XmlDocument> document = copy_with_places(*mjcf.document);
  XmlElement& root = *document->RootElement();
  std::vector<std::string> left_out;
  translate_mjcf(root, mjcf, LostShape::kGone, left_out);
  bool meshes = false;
  walk(root, [&](XmlElement& e) { meshes |= is(e, "mesh"); });
  if (!meshes) return xml_text(*document);
  const MujocoModel m = compile_mjcf(mjcf);
  const Elements elements = find_elements(root, *m, mjcf);
  for (int b = 1; b < m->nbody; ++b) write_mjcf_inertial(*elements.bodies[b], body_inertia(*m, b));
  trust_stated_inertias(root);
  strip_looks(root, mjcf, false, LostShape::kGone, left_out);
  return xml_text(*document);
}

}  // namespace diffnea::io
