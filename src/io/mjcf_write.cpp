/// Values of a model into the MJCF that it was read from.

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_ball.hpp"
#include "io/mjcf_inertial.hpp"
#include "io/mjcf_parts.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Elements of bodies and joints in the order of MuJoCo's numbers.
struct Elements {
  std::vector<XmlElement*> bodies{nullptr};  ///< 0 is the world
  std::vector<XmlElement*> joints;
};
Elements find_elements(XmlElement& root, const mjModel& m, const std::string& where) {
  Elements out;
  for_each_child(root, "worldbody", [&](XmlElement& world) {
    walk(world, [&](XmlElement& e) {
      if (is(e, "body")) out.bodies.push_back(&e);
      if (is(e, "joint") || is(e, "freejoint")) out.joints.push_back(&e);
    });
  });
  bool ok = out.bodies.size() == static_cast<std::size_t>(m.nbody) &&
            out.joints.size() == static_cast<std::size_t>(m.njnt);
  for (int b = 1; ok && b < m.nbody; ++b)
    ok = attribute(*out.bodies[b], "name").empty() ||
         attribute(*out.bodies[b], "name") == body_name(m, b);
  if (!ok)
    throw ModelError(
        where +
        ": its bodies are generated (composite, replicate): values cannot be written in "
        "place; write the model as .json");
  return out;
}

/// The ball of `now` where it differs from `then`, which was read from the document.
/// @return whether its mass did
bool write_ball(XmlElement& root, const Elements& elements, const mjModel& m,
                const std::string& where, const Model& now, const Model& then,
                std::vector<std::string>& notes) {
  if (now.ball.has_value() != then.ball.has_value()) {
    notes.emplace_back(now.ball ? "the ball" : "that there is no ball");
    return false;
  }
  if (!now.ball) return false;
  std::vector<std::string> said_when_read;
  const MjcfBall parts = *find_ball(m, where, said_when_read);
  write_string(root, m, parts, *now.ball, *then.ball, notes);
  if (now.ball->radius != then.ball->radius) notes.emplace_back("the changed radius of the ball");
  if (now.ball->mass == then.ball->mass) return false;
  Theta<double> theta = body_inertia(m, parts.body).theta();
  const double ratio = now.ball->mass / theta[0];  // of equal shape
  for (double& x : theta) x *= ratio;
  theta[0] = now.ball->mass;
  write_mjcf_inertial(*elements.bodies[parts.body], SpatialInertia<double>::from_theta(theta));
  return true;
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

/// What would overrule the inertias written here.
void trust_stated_inertias(XmlElement& root) {
  for_each_child(root, "compiler", [](XmlElement& c) {
    for (const char* name : {"balanceinertia", "boundmass", "boundinertia", "settotalmass"})
      c.DeleteAttribute(name);
    if (attribute(c, "inertiafromgeom") == "true") c.SetAttribute("inertiafromgeom", "auto");
  });
}

bool angles_in_degrees(XmlElement& root) {
  bool degrees = true;
  for_each_child(root, "compiler", [&](XmlElement& c) {
    if (c.Attribute("angle")) degrees = attribute(c, "angle") == "degree";
  });
  return degrees;
}

void write_joint(XmlElement& e, const ModelLink& now, const ModelLink& then, const JointTerms& a,
                 const JointTerms& b, bool degrees) {
  const double angle = degrees && now.type == ModelJoint::kRevolute ? 180.0 / M_PI : 1.0;
  const auto set = [&](const char* name, double x, double y, double unit = 1.0) {
    if (x != y) e.SetAttribute(name, exact(x * unit).c_str());
  };
  set("damping", a.viscous, b.viscous);
  set("frictionloss", a.coulomb, b.coulomb);
  set("armature", a.armature, b.armature);
  set("stiffness", a.stiffness, b.stiffness);
  if (a.stiffness != 0.0) set("springref", a.rest, b.rest, angle);
  if (now.limits.lower == then.limits.lower && now.limits.upper == then.limits.upper) return;
  const bool limited = std::isfinite(now.limits.lower) && std::isfinite(now.limits.upper);
  e.SetAttribute("limited", limited ? "true" : "false");
  if (limited)
    e.SetAttribute(
        "range", (exact(now.limits.lower * angle) + " " + exact(now.limits.upper * angle)).c_str());
}

}  // namespace

std::string mjcf_with_values(const std::string& original, const std::filesystem::path& folder,
                             const std::string& where, const Model& model,
                             std::vector<std::string>& notes) {
  const Mjcf mjcf = expand_mjcf(original, folder, where);
  const MujocoModel m = compile_mjcf(mjcf);
  const Model before = model_from_mujoco(*m, where);
  XmlElement& root = *mjcf.document->RootElement();
  const Elements elements = find_elements(root, *m, where);
  const bool degrees = angles_in_degrees(root);

  const auto alike = [](const ModelLink& a, const ModelLink& b) {
    return a.name == b.name && a.joint == b.joint && a.type == b.type;
  };
  if (!std::ranges::equal(model.links, before.links, alike))
    throw ModelError(where + ": its links are not those of the model '" + model.name +
                     "'; write the model as .json");

  int link = 0;
  bool inertia_changed = write_ball(root, elements, *m, where, model, before, notes);
  const std::vector<bool> left_out = left_out_bodies(*m, where);
  for (int b = 1; b < m->nbody; ++b) {
    if (left_out[b]) continue;
    for (int k = 0; k < std::max(1, m->body_jntnum[b]); ++k, ++link) {
      const ModelLink &now = model.links[link], &then = before.links[link];
      const bool last = k + 1 >= m->body_jntnum[b];
      if (!same(now.inertia, then.inertia)) {
        inertia_changed = true;
        if (last) {  // the link's origin is the joint's anchor, the body's is where the file has it
          const Vec3<double> p =
              m->body_jntnum[b] ? vec(m->jnt_pos + 3 * (m->body_jntadr[b] + k)) : Vec3<double>{};
          write_mjcf_inertial(*elements.bodies[b], to_parent(shift(p), now.inertia));
        } else {
          notes.push_back("inertia of '" + now.name + "', a link without a body of its own");
        }
      }
      if (!same(now.X_PJ, then.X_PJ)) notes.push_back("the changed pose of '" + now.name + "'");
      if (m->body_jntnum[b] == 0) continue;
      write_joint(*elements.joints[m->body_jntadr[b] + k], now, then, joint_terms(model, now.joint),
                  joint_terms(before, now.joint), degrees);
      if (now.passive != then.passive)
        notes.push_back("whether joint '" + now.joint + "' is passive");
      if (now.limits.effort != then.limits.effort)
        notes.push_back("the effort limit of '" + now.joint + "'");
      if (now.limits.velocity != then.limits.velocity)
        notes.push_back("the velocity limit of '" + now.joint + "'");
    }
  }
  if (inertia_changed) trust_stated_inertias(root);
  const Vec3<double> g = model.gravity - before.gravity;
  if (dot(g, g) != 0.0) child(root, "option").SetAttribute("gravity", exact(model.gravity).c_str());
  if (!same_surroundings(model, before))
    notes.emplace_back("the changed cup or obstacles of the ball");
  for (const EffectSpec& e : model.effects)
    if (!is_joint_term(model, e)) notes.push_back(e.effect + " at " + e.where);
  if (model.posterior) notes.emplace_back("the posterior of the parameters");
  return xml_text(*mjcf.document);
}

std::string self_contained_mjcf(const Mjcf& mjcf) {
  XmlDocument document;
  mjcf.document->DeepCopy(&document);
  XmlElement& root = *document.RootElement();
  strip_looks(root, inertia_from_geoms(root), LostShape::kGone);
  bool meshes = false;
  walk(root, [&](XmlElement& e) { meshes |= is(e, "mesh"); });
  if (!meshes) return xml_text(document);
  const MujocoModel m = compile_mjcf(mjcf);
  const Elements elements = find_elements(root, *m, mjcf.where);
  for (int b = 1; b < m->nbody; ++b) write_mjcf_inertial(*elements.bodies[b], body_inertia(*m, b));
  trust_stated_inertias(root);
  strip_looks(root, false, LostShape::kGone);
  return xml_text(document);
}

}  // namespace diffnea::io
