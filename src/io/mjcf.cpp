#include "io/mjcf.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/io/atomic_file.hpp>

#include "io/mjcf_ball.hpp"
#include "io/mjcf_cup.hpp"
#include "io/mjcf_inertial.hpp"
#include "io/mjcf_limits.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Includes in includes; a chain this long is a mistake or an attack.
constexpr int kMaxIncludeDepth = 16;

void expand(XmlElement& element, const std::filesystem::path& folder, const std::string& where,
            std::set<std::filesystem::path>& seen, int depth) {
  if (depth > kMaxIncludeDepth) throw ModelError(where + ": includes are nested too deeply");
  for_each_child(element, nullptr, [&](XmlElement& e) {
    if (std::strcmp(e.Name(), "include") != 0) return expand(e, folder, where, seen, depth);
    const std::string name = attribute(e, "file");
    if (name.empty()) throw ModelError(where + ": <include> names no file");
    const std::filesystem::path path = confined_path(folder, name, where + ": <include>");
    if (!seen.insert(path).second)  // MuJoCo's own rule
      throw ModelError(where + ": includes '" + name + "' more than once");
    const std::unique_ptr<XmlDocument> included = parse_xml(read_text_file(path), path.string());
    expand(*included->RootElement(), folder, where, seen, depth + 1);
    tinyxml2::XMLNode* after = &e;
    for (XmlElement* c = included->RootElement()->FirstChildElement(); c;
         c = c->NextSiblingElement())
      after = element.InsertAfterChild(after, c->DeepClone(element.GetDocument()));
    element.DeleteChild(&e);
  });
}

bool inertia_from_geoms(XmlElement& root) {
  bool forced = false;
  for_each_child(root, "compiler",
                 [&](XmlElement& c) { forced |= attribute(c, "inertiafromgeom") == "true"; });
  return forced;
}

/// Removes what needs files and has no mass, so that a model compiles where its looks are missing.
void strip_looks(XmlElement& root, bool weigh_all) {
  std::set<std::string> used_meshes;
  for_each_child(root, "visual", [&](XmlElement& e) { root.DeleteChild(&e); });
  for_each_child(root, "statistic", [&](XmlElement& e) { root.DeleteChild(&e); });
  walk(root, [&](XmlElement& e) {
    for_each_child(e, nullptr, [&](XmlElement& c) {
      const bool states_inertia = e.FirstChildElement("inertial") && !weigh_all;
      if (is(c, "texture") || is(c, "hfield") || is(c, "skin"))
        e.DeleteChild(&c);
      else if (is(c, "geom") && (c.Attribute("hfield") || (c.Attribute("mesh") && states_inertia)))
        e.DeleteChild(&c);
      else if (is(c, "geom") && c.Attribute("mesh"))
        used_meshes.insert(attribute(c, "mesh"));
      else if (is(c, "material"))
        c.DeleteAttribute("texture");
    });
  });
  for_each_child(root, "asset", [&](XmlElement& asset) {
    for_each_child(asset, "mesh", [&](XmlElement& mesh) {
      std::string name = attribute(mesh, "name");
      if (name.empty()) name = std::filesystem::path(attribute(mesh, "file")).stem().string();
      if (!used_meshes.contains(name)) asset.DeleteChild(&mesh);
    });
  });
}

/// The compiler would simulate an actuator to learn its length, for as long as the document says,
/// and make room for a simulation and its sensors. No model holds any of it.
void without_simulation(XmlElement& root) {
  for (const char* name : {"size", "sensor"}) remove_children(root, name);
  for_each_child(root, "compiler", [](XmlElement& c) { remove_children(c, "lengthrange"); });
  child(child(root, "compiler"), "lengthrange").SetAttribute("mode", "none");
}

/// Meshes that give a body its inertia: checked, loaded, and renamed to flat names in memory.
void add_meshes(XmlElement& root, const Mjcf& mjcf, sim::MujocoFiles& files) {
  std::string mesh_folder;
  for_each_child(root, "compiler", [&](XmlElement& c) {
    for (const char* name : {"assetdir", "meshdir"})
      if (c.Attribute(name)) mesh_folder = attribute(c, name);
    for (const char* name : {"assetdir", "meshdir", "texturedir"}) c.DeleteAttribute(name);
  });
  int count = 0;
  walk(root, [&](XmlElement& mesh) {
    if (!is(mesh, "mesh") || !mesh.Attribute("file")) return;
    const std::filesystem::path file = attribute(mesh, "file");
    if (!mesh.Attribute("name")) mesh.SetAttribute("name", file.stem().string().c_str());
    const std::filesystem::path path =
        confined_path(mjcf.folder, (std::filesystem::path(mesh_folder) / file).string(),
                      mjcf.where + ": mesh '" + attribute(mesh, "name") + "'");
    const std::string flat = "mesh" + std::to_string(count++) + path.extension().string();
    files.add(flat, read_text_file(path), mjcf.where);
    mesh.SetAttribute("file", flat.c_str());
  });
}

Pose<double> pose(const mjtNum* p, const mjtNum* quat) {
  return {rotation_from_quaternion(quat[0], quat[1], quat[2], quat[3]), {p[0], p[1], p[2]}};
}

Pose<double> shift(const Vec3<double>& p) { return {Mat3<double>::identity(), p}; }

Vec3<double> vec(const mjtNum* v) { return {v[0], v[1], v[2]}; }

void note_once(std::vector<std::string>& notes, const std::string& note) {
  if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
}

const char* object_name(const mjModel& m, mjtObj type, int id, const char* fallback) {
  const char* name = mj_id2name(&m, type, id);
  return name ? name : fallback;
}

/// Largest torque that the actuators can put on a joint; infinite if one is not limited.
struct Actuation {
  bool acts = false;
  double limit = 0.0;
};
/// One entry a joint; empty if the file has no actuators, or some whose joints cannot be told.
std::vector<Actuation> actuation(const mjModel& m, std::vector<std::string>& notes) {
  std::vector<Actuation> out(static_cast<std::size_t>(m.njnt));
  for (int a = 0; a < m.nu; ++a) {
    if (m.actuator_trntype[a] != mjTRN_JOINT && m.actuator_trntype[a] != mjTRN_JOINTINPARENT) {
      note_once(notes, "an actuator that does not act on one joint is left out");
      return {};
    }
    Actuation& joint = out[m.actuator_trnid[2 * a]];
    const double gear = std::abs(m.actuator_gear[6 * a]);
    const auto largest = [&](const mjtNum* range) {
      return std::max(std::abs(range[2 * a]), std::abs(range[2 * a + 1]));
    };
    double limit = std::numeric_limits<double>::infinity();
    if (m.actuator_forcelimited[a]) limit = gear * largest(m.actuator_forcerange);
    if (m.actuator_ctrllimited[a] && m.actuator_gaintype[a] == mjGAIN_FIXED &&
        m.actuator_biastype[a] == mjBIAS_NONE && m.actuator_dyntype[a] == mjDYN_NONE)
      limit = std::min(
          limit, gear * std::abs(m.actuator_gainprm[mjNGAIN * a]) * largest(m.actuator_ctrlrange));
    joint.acts = true;
    joint.limit += limit;
  }
  return m.nu > 0 ? out : std::vector<Actuation>{};
}

void refuse_closed_loops(const mjModel& m, const std::vector<bool>& left_out,
                         const std::string& where) {
  for (int e = 0; e < m.neq; ++e) {
#if mjVERSION_HEADER >= 300
    if (!m.eq_active0[e]) continue;
#else
    if (!m.eq_active[e]) continue;
#endif
    const int type = m.eq_type[e], a = m.eq_obj1id[e], b = m.eq_obj2id[e];
    if ((type == mjEQ_CONNECT || type == mjEQ_WELD) &&
        ((a >= 0 && left_out[a]) || (b >= 0 && left_out[b])))
      continue;
    throw ModelError(
        where + ": equality constraint '" +
        object_name(m, mjOBJ_EQUALITY, e, ("number " + std::to_string(e)).c_str()) +
        "' couples joints or closes a loop; a robot must be a tree of independent joints: "
        "remove it, or make one of the joints fixed");
  }
}

void note_what_is_left_out(const mjModel& m, std::vector<std::string>& notes) {
  for (int t = 0; t < m.ntendon; ++t)
    if (m.tendon_stiffness[t] != 0 || m.tendon_damping[t] != 0 || m.tendon_frictionloss[t] != 0)
      notes.push_back("stiffness, damping and friction of tendon '" +
                      std::string(object_name(m, mjOBJ_TENDON, t, "")) + "' are left out");
  if (m.opt.density != 0 || m.opt.viscosity != 0)
    notes.emplace_back("drag of the medium is left out");
}

/// Joint `j`'s link: its frame sits at the joint's anchor with the body's axes, turned back by
/// `ref`.
ModelLink joint_link(const mjModel& m, int j, const Pose<double>& X_PB, const std::string& where) {
  ModelLink link;
  link.joint = joint_name(m, j);
  if (m.jnt_type[j] != mjJNT_HINGE && m.jnt_type[j] != mjJNT_SLIDE)
    throw ModelError(
        where + ": joint '" + link.joint + "' of body '" + body_name(m, m.jnt_bodyid[j]) +
        "' is a " + (m.jnt_type[j] == mjJNT_FREE ? "free" : "ball") +
        " joint: only robots whose base is fixed and whose joints have one degree of freedom are "
        "supported; types: hinge, slide (a free body named 'ball' is a ball)");
  link.type = m.jnt_type[j] == mjJNT_HINGE ? ModelJoint::kRevolute : ModelJoint::kPrismatic;
  link.axis = vec(m.jnt_axis + 3 * j);
  const double ref = m.qpos0[m.jnt_qposadr[j]];
  link.X_PJ = X_PB * shift(vec(m.jnt_pos + 3 * j));
  if (ref != 0.0)
    link.X_PJ = link.X_PJ * (link.type == ModelJoint::kRevolute
                                 ? Pose<double>{rotation_about<double>(link.axis, -ref), {}}
                                 : shift(link.axis * -ref));
  if (m.jnt_limited[j]) {
    link.limits.lower = m.jnt_range[2 * j];
    link.limits.upper = m.jnt_range[2 * j + 1];
  }
  return link;
}

/// About the body's origin, in the body.
SpatialInertia<double> body_inertia(const mjModel& m, int b) {
  if (!(m.body_mass[b] > 0)) return {};
  const mjtNum* I = m.body_inertia + 3 * b;
  const SpatialInertia<double> M_C =
      inertia_from_com<double>(m.body_mass[b], {}, {I[0], 0, 0, I[1], 0, I[2]});
  return to_parent(pose(m.body_ipos + 3 * b, m.body_iquat + 4 * b), M_C);
}

JointTerms mujoco_terms(const mjModel& m, int j) {
  const int dof = m.jnt_dofadr[j];
  JointTerms t;
  t.viscous = m.dof_damping[dof];
  t.coulomb = m.dof_frictionloss[dof];
  t.armature = m.dof_armature[dof];
  t.stiffness = m.jnt_stiffness[j];
  t.rest = m.qpos_spring[m.jnt_qposadr[j]];
  return t;
}

}  // namespace

Mjcf expand_mjcf(const std::string& text, const std::filesystem::path& folder,
                 const std::string& where) {
  Mjcf out{parse_xml(text, where), folder.empty() ? std::filesystem::path(".") : folder, where};
  std::set<std::filesystem::path> seen;
  expand(*out.document->RootElement(), out.folder, where, seen, 0);
  check_mjcf(*out.document->RootElement(), where);
  return out;
}

MujocoModel compile_mjcf(const Mjcf& mjcf) {
  XmlDocument document;
  mjcf.document->DeepCopy(&document);
  XmlElement& root = *document.RootElement();
  strip_looks(root, inertia_from_geoms(root));
  without_simulation(root);
  sim::MujocoFiles files;
  add_meshes(root, mjcf, files);
  return sim::compile_mujoco(xml_text(document), files, mjcf.where);
}

std::string body_name(const mjModel& m, int body) {
  return object_name(m, mjOBJ_BODY, body, ("body" + std::to_string(body)).c_str());
}
std::string joint_name(const mjModel& m, int joint) {
  return object_name(m, mjOBJ_JOINT, joint, ("joint" + std::to_string(joint)).c_str());
}

Model model_from_mujoco(const mjModel& m, const std::string& where) {
  Model model;
  model.name = m.names;
  model.source = where;
  model.gravity = m.opt.disableflags & mjDSBL_GRAVITY ? Vec3<double>{} : vec(m.opt.gravity);
  const std::vector<bool> left_out = left_out_bodies(m, where);
  refuse_closed_loops(m, left_out, where);
  const std::optional<MjcfBall> ball = find_ball(m, where, model.notes);
  note_what_is_left_out(m, model.notes);
  const std::vector<Actuation> actuators = actuation(m, model.notes);
  const int home = mj_name2id(&m, mjOBJ_KEY, "home");

  std::vector<BodyAt> bodies(static_cast<std::size_t>(m.nbody));
  for (int b = 1; b < m.nbody; ++b) {
    if (left_out[b]) continue;
    const BodyAt parent = bodies[m.body_parentid[b]];
    BodyAt at = parent;
    // The pose of the body in the link at hand, before the joint under consideration moves it.
    Pose<double> X_PB = parent.X_LB * pose(m.body_pos + 3 * b, m.body_quat + 4 * b);
    const auto append = [&](ModelLink link) {
      link.parent = at.link;
      at.link = static_cast<int>(model.links.size());
      model.links.push_back(std::move(link));
    };
    if (m.body_jntnum[b] == 0) {
      ModelLink link;
      link.name = body_name(m, b);
      link.X_PJ = X_PB;
      append(link);
      at.X_LB = Pose<double>::identity();
    }
    for (int k = 0; k < m.body_jntnum[b]; ++k) {
      const int j = m.body_jntadr[b] + k;
      ModelLink link = joint_link(m, j, X_PB, where);
      const bool last = k + 1 == m.body_jntnum[b];
      link.name = body_name(m, b) + (last ? "" : "/" + link.joint);
      if (!actuators.empty()) {
        link.passive = !actuators[j].acts;
        if (actuators[j].acts) link.limits.effort = actuators[j].limit;
      }
      add_joint_terms(model, link, mujoco_terms(m, j));
      append(link);
      if (home >= 0) model.home.push_back(m.key_qpos[home * m.nq + m.jnt_qposadr[j]]);
      at.X_LB = X_PB = shift(-vec(m.jnt_pos + 3 * j));
    }
    bodies[b] = at;
    model.links[at.link].inertia = to_parent(at.X_LB, body_inertia(m, b));
  }
  for (int s = 0; s < m.nsite; ++s) {
    const int b = m.site_bodyid[s];
    const char* name = mj_id2name(&m, mjOBJ_SITE, s);
    if (!name || left_out[b]) continue;
    model.frames.push_back(
        {name, bodies[b].link, bodies[b].X_LB * pose(m.site_pos + 3 * s, m.site_quat + 4 * s)});
  }
  if (ball) {
    const BodyAt at = ball->tendon < 0 ? BodyAt{} : bodies[m.site_bodyid[ball->anchor]];
    model.ball = ball_spec(m, *ball, at.link, at.X_LB);
  }
  model.cup = find_cup(m, where);
  if (ball && model.cup)
    model.obstacles = find_obstacles(m, ball->body, bodies, left_out, model.notes);
  validate(model, where);
  return model;
}

Model model_from_mjcf(const std::string& text, const std::filesystem::path& folder,
                      const std::string& where) {
  return model_from_mujoco(*compile_mjcf(expand_mjcf(text, folder, where)), where);
}

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
  strip_looks(root, inertia_from_geoms(root));
  bool meshes = false;
  walk(root, [&](XmlElement& e) { meshes |= is(e, "mesh"); });
  if (!meshes) return xml_text(document);
  const MujocoModel m = compile_mjcf(mjcf);
  const Elements elements = find_elements(root, *m, mjcf.where);
  for (int b = 1; b < m->nbody; ++b) write_mjcf_inertial(*elements.bodies[b], body_inertia(*m, b));
  trust_stated_inertias(root);
  strip_looks(root, false);
  return xml_text(document);
}

}  // namespace diffnea::io
