#include "io/mjcf.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <diffnea/core/error.hpp>

#include "io/mjcf_ball.hpp"
#include "io/mjcf_constraints.hpp"
#include "io/mjcf_cup.hpp"
#include "io/mjcf_limits.hpp"
#include "io/mjcf_loops.hpp"
#include "io/mjcf_parts.hpp"
#include "io/mjcf_versions.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

Pose<double> pose(const mjtNum* p, const mjtNum* quat) {
  return {rotation_from_quaternion(quat[0], quat[1], quat[2], quat[3]), {p[0], p[1], p[2]}};
}

/// Joints that an actuator moves which acts on no single one: those of its tendon; where it pulls
/// at bodies, those between them.
std::vector<int> moved_joints(const mjModel& m, int actuator) {
  std::vector<int> bodies;
  std::vector<int> pulled_with(static_cast<std::size_t>(m.njnt));  // how many of the bodies
  std::vector<bool> moved(static_cast<std::size_t>(m.njnt));
  const auto pull_at_site = [&](int site) { bodies.push_back(site < 0 ? 0 : m.site_bodyid[site]); };
  const int id = m.actuator_trnid[2 * actuator], other = m.actuator_trnid[2 * actuator + 1];
  if (m.actuator_trntype[actuator] == mjTRN_TENDON) {
    for (int w = m.tendon_adr[id]; w < m.tendon_adr[id] + m.tendon_num[id]; ++w) {
      const int object = m.wrap_objid[w];
      if (m.wrap_type[w] == mjWRAP_JOINT) moved[object] = true;
      if (m.wrap_type[w] == mjWRAP_SITE) pull_at_site(object);
      if (m.wrap_type[w] == mjWRAP_SPHERE || m.wrap_type[w] == mjWRAP_CYLINDER)
        bodies.push_back(m.geom_bodyid[object]);
    }
  } else if (m.actuator_trntype[actuator] == mjTRN_SITE ||
             m.actuator_trntype[actuator] == mjTRN_SLIDERCRANK) {
    pull_at_site(id);
    pull_at_site(other);
  }
  for (const int pulled : bodies)
    for (int b = pulled; b > 0; b = m.body_parentid[b])
      for (int k = 0; k < m.body_jntnum[b]; ++k) ++pulled_with[m.body_jntadr[b] + k];
  std::vector<int> out;
  for (int j = 0; j < m.njnt; ++j)
    if (moved[j] || (pulled_with[j] > 0 && pulled_with[j] < static_cast<int>(bodies.size())))
      out.push_back(j);
  return out;
}

/// Sum of what the actuators of a joint do.
struct Actuation {
  bool acts = false;
  double limit = 0.0;                    ///< largest torque; infinite if one is not limited
  std::optional<ServoGains> servo = {};  ///< none, unless one stands alone
};

/// Gains of an actuator that pulls a joint to a position; none of another kind.
std::optional<ServoGains> servo_gains(const mjModel& m, int a) {
  constexpr double kSame = 1e-9;  // rounding of a number written twice
  const mjtNum *gain = m.actuator_gainprm + mjNGAIN * a, *bias = m.actuator_biasprm + mjNBIAS * a;
  const bool filters = m.actuator_dyntype[a] == mjDYN_NONE || m.actuator_dyntype[a] == mjDYN_FILTER;
  if (!filters || m.actuator_gaintype[a] != mjGAIN_FIXED || m.actuator_biastype[a] != mjBIAS_AFFINE)
    return std::nullopt;
  const double kp = gain[0], gear = m.actuator_gear[6 * a];
  if (!(kp > 0.0) || gear == 0.0 || std::abs(bias[1] + kp) > kSame * kp) return std::nullopt;
  double kd = std::max(-bias[2], 0.0);
  if (m.nuser_actuator > kDampingRatio) {
    const mjtNum* later = m.actuator_user + static_cast<std::ptrdiff_t>(m.nuser_actuator) * a;
    // Mobility (M⁻¹)_jj where all other joints are free, in the file's posture.
    const double mobility = gear * gear * m.dof_invweight0[m.jnt_dofadr[m.actuator_trnid[2 * a]]];
    kd += later[kDriveDamping] + 2.0 * later[kDampingRatio] * std::sqrt(kp / mobility);
  }
  return ServoGains{gear * gear * kp, gear * gear * kd};
}

/// One entry a joint; empty if the file has no actuators.
std::vector<Actuation> actuation(const mjModel& m, std::vector<std::string>& notes) {
  constexpr double kNoLimit = std::numeric_limits<double>::infinity();
  std::vector<Actuation> out(static_cast<std::size_t>(m.njnt));
  std::string shared;
  for (int a = 0; a < m.nu; ++a) {
    if (m.actuator_trntype[a] != mjTRN_JOINT && m.actuator_trntype[a] != mjTRN_JOINTINPARENT) {
      for (const int j : moved_joints(m, a)) out[j] = {true, kNoLimit};
      shared += (shared.empty() ? "'" : ", '") +
                std::string(object_name(m, mjOBJ_ACTUATOR, a, std::to_string(a).c_str())) + "'";
      continue;
    }
    Actuation& joint = out[m.actuator_trnid[2 * a]];
    const double gear = std::abs(m.actuator_gear[6 * a]);
    const auto largest = [&](const mjtNum* range) {
      return std::max(std::abs(range[2 * a]), std::abs(range[2 * a + 1]));
    };
    double limit = kNoLimit;
    if (m.actuator_forcelimited[a]) limit = gear * largest(m.actuator_forcerange);
    if (m.actuator_ctrllimited[a] && m.actuator_gaintype[a] == mjGAIN_FIXED &&
        m.actuator_biastype[a] == mjBIAS_NONE && m.actuator_dyntype[a] == mjDYN_NONE)
      limit = std::min(
          limit, gear * std::abs(m.actuator_gainprm[mjNGAIN * a]) * largest(m.actuator_ctrlrange));
    joint.servo = joint.acts ? std::nullopt : servo_gains(m, a);
    joint.acts = true;
    joint.limit += limit;
  }
  if (!shared.empty())
    notes.push_back("actuators that do not act on one joint (" + shared +
                    "): the joints that they move count as driven, without a limit of effort");
  return m.nu > 0 ? out : std::vector<Actuation>{};
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
ModelLink joint_link(const mjModel& m, int j, const Pose<double>& X_PB, const Mjcf& mjcf) {
  ModelLink link;
  link.joint = joint_name(m, j);
  if (m.jnt_type[j] == mjJNT_BALL) {
    const std::string body = body_name(m, m.jnt_bodyid[j]);
    throw ModelError(
        mjcf.where + ": joint '" + link.joint + "' of body '" + body + "'" +
        mjcf.line_of("body", body) +
        " is a ball joint: only joints of one degree of freedom are supported, and a free base; "
        "types: hinge, slide. A ball joint can be drawn as three hinges at one point, with "
        "massless bodies between");
  }
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

/// Largest force that all drives of a joint can have together; infinite if it has no such limit.
double largest_drive_force(const mjModel& m, int j) {
  const double none = std::numeric_limits<double>::infinity();
  if (m.nuser_jnt < 2) return none;
  const mjtNum* range = m.jnt_user + static_cast<std::ptrdiff_t>(m.nuser_jnt) * j;
  return range[0] < range[1] ? std::max(std::abs(range[0]), std::abs(range[1])) : none;
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

/// Turns a joint into a fixed one where it would be at q.
void lock(ModelLink& link, double q) {
  Link<double> joint;
  joint.type = link.type == ModelJoint::kRevolute ? JointType::kRevolute : JointType::kPrismatic;
  joint.axis = link.axis;
  joint.X_PJ = link.X_PJ;
  link.X_PJ = joint_pose(joint, q);
  link.type = ModelJoint::kFixed;
  link.limits = {};
  link.passive = false;
  link.servo.reset();
}

/// Lets a joint have the drives of those that follow it: actuators may sit at any of them.
void share_drives(Model& model) {
  const std::vector<TreeJoint> joints = tree_joints(model);
  const std::vector<int> links = tree_links(model), moving = moving_links(model);
  for (const TreeJoint& j : joints) {
    const ModelLink& follower = model.links[links[j.link]];
    if (!j.follows || follower.passive || j.drive.ratio == 0.0) continue;
    ModelLink& leader = model.links[moving[j.drive.dof]];
    const double effort = std::abs(j.drive.ratio) * follower.limits.effort;
    leader.limits.effort = leader.passive ? effort : leader.limits.effort + effort;
    leader.passive = false;
  }
}

}  // namespace

/// About the body's origin, in the body.
SpatialInertia<double> body_inertia(const mjModel& m, int b) {
  if (!(m.body_mass[b] > 0)) return {};
  const mjtNum* I = m.body_inertia + 3 * b;
  const SpatialInertia<double> M_C =
      inertia_from_com<double>(m.body_mass[b], {}, {I[0], 0, 0, I[1], 0, I[2]});
  return to_parent(pose(m.body_ipos + 3 * b, m.body_iquat + 4 * b), M_C);
}

/// Link of a body that floats: the robot's base.
ModelLink base_link(const mjModel& m, int b, const Pose<double>& X_WB,
                    std::vector<std::string>& notes) {
  const int j = m.body_jntadr[b], dof = m.jnt_dofadr[j];
  ModelLink link;
  link.name = body_name(m, b);
  link.joint = object_name(m, mjOBJ_JOINT, j, "");
  link.X_PJ = X_WB;
  const auto any = [&](const mjtNum* of_dofs) {
    return std::any_of(of_dofs + dof, of_dofs + dof + 6, [](double x) { return x != 0.0; });
  };
  if (any(m.dof_damping) || any(m.dof_armature) || any(m.dof_frictionloss) ||
      m.jnt_stiffness[j] != 0.0)
    notes.push_back("damping, friction, armature and stiffness of the free joint of body '" +
                    link.name + "' are left out: its base floats without");
  return link;
}

/// Bodies that stand beside a robot that floats.
void note_what_stands(const mjModel& m, const std::vector<bool>& left_out,
                      std::vector<std::string>& notes) {
  std::string names;
  for (int b = 1; b < m.nbody; ++b)
    if (left_out[b] && m.body_parentid[b] == 0 && !is_free(m, b))
      names += (names.empty() ? "'" : ", '") + body_name(m, b) + "'";
  if (!names.empty()) notes.push_back("bodies that stand beside the robot are left out: " + names);
}

std::string body_name(const mjModel& m, int body) {
  return object_name(m, mjOBJ_BODY, body, ("body" + std::to_string(body)).c_str());
}
std::string joint_name(const mjModel& m, int joint) {
  return object_name(m, mjOBJ_JOINT, joint, ("joint" + std::to_string(joint)).c_str());
}

Model model_from_mujoco(const mjModel& m, const Mjcf& mjcf) {
  const std::string& where = mjcf.where;
  Model model;
  model.name = m.names;
  model.source = where;
  model.gravity = m.opt.disableflags & mjDSBL_GRAVITY ? Vec3<double>{} : vec(m.opt.gravity);
  const std::vector<bool> left_out = left_out_bodies(m, mjcf);
  const std::vector<JointCoupling> couplings = joint_couplings(m, left_out, mjcf, model.notes);
  const std::optional<MjcfBall> ball = find_ball(m, where, model.notes);
  note_what_is_left_out(m, model.notes);
  note_what_stands(m, left_out, model.notes);
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
    if (is_free(m, b)) {
      model.free_base = true;
      append(base_link(m, b, X_PB, model.notes));
      at.X_LB = Pose<double>::identity();
    }
    for (int k = 0; k < m.body_jntnum[b] && !is_free(m, b); ++k) {
      const int j = m.body_jntadr[b] + k;
      ModelLink link = joint_link(m, j, X_PB, mjcf);
      const bool last = k + 1 == m.body_jntnum[b];
      link.name = body_name(m, b) + (last ? "" : "/" + link.joint);
      if (!actuators.empty()) {
        link.passive = !actuators[j].acts;
        if (actuators[j].acts) link.limits.effort = actuators[j].limit;
        link.servo = actuators[j].servo;
      }
      if (!link.passive)
        link.limits.effort = std::min(link.limits.effort, largest_drive_force(m, j));
      if (couplings[j].locked_at) {
        lock(link, *couplings[j].locked_at);
        model.notes.push_back("joint '" + link.joint +
                              "' is locked by an equality constraint, at " +
                              exact(*couplings[j].locked_at));
      } else {
        add_joint_terms(model, link, mujoco_terms(m, j));
      }
      link.follows = couplings[j].follows;
      append(link);
      if (home >= 0 && link.type != ModelJoint::kFixed && !link.follows)
        model.home.push_back(m.key_qpos[home * m.nq + m.jnt_qposadr[j]]);
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
  if (!mjcf.reading.open_loops)
    model.constraints = loop_constraints(m, left_out, [&](int b) {
      return b <= 0 ? std::pair{-1, Pose<double>::identity()}
                    : std::pair{bodies[b].link, bodies[b].X_LB};
    });
  if (ball) {
    const BodyAt at = ball->tendon < 0 ? BodyAt{} : bodies[m.site_bodyid[ball->anchor]];
    model.ball = ball_spec(m, *ball, at.link, at.X_LB);
  }
  share_drives(model);
  model.cup = find_cup(m, where);
  if (ball && model.cup)
    model.obstacles = find_obstacles(m, ball->body, bodies, left_out, model.notes);
  validate(model, where);
  return model;
}

Model model_from_mjcf(const std::string& text, const std::filesystem::path& folder,
                      const std::string& where, const ModelReading& reading) {
  const Mjcf mjcf = expand_mjcf(text, folder, where, reading);
  std::vector<std::string> notes;
  const MujocoModel m = compile_mjcf(mjcf, &notes);
  Model model = model_from_mujoco(*m, mjcf);
  if (reading.free_base && !model.free_base)
    throw ModelError(where +
                     ": its base is fixed: --free-base (free_base=True) frees that of a URDF "
                     "or JSON; put a <freejoint/> into its uppermost body");
  model.notes.insert(model.notes.begin(), notes.begin(), notes.end());
  return model;
}

}  // namespace diffnea::io
