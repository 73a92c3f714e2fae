#include <algorithm>
#include <cmath>
#include <numbers>

#include "mechanisms.hpp"

namespace hidden {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// Motor and link share the armature that the model declares: it becomes the rotor's.
double rotor_inertia(const Draw& draw, int j) { return draw.link(j).armature; }

/// Of the two inertias that swing against each other.
double reduced_inertia(const Draw& draw, int j) {
  const double rotor = rotor_inertia(draw, j);
  const double link = std::max(draw.scales.inertia[j] - rotor, 0.1 * draw.scales.inertia[j]);
  return rotor * link / (rotor + link);
}

double stiffness_at(double frequency, double inertia) {
  const double w = kTurn * frequency;
  return w * w * inertia;
}

void free_rotor(mjModel& m, const State& x, int j, double inertia) {
  m.dof_armature[x.dof[j]] = 0.0;
  m.dof_armature[x.motor_dof[j]] = inertia;
}

Mechanism elasticity(int j, const Draw& draw) {
  Mechanism h;
  const double rotor = rotor_inertia(draw, j), reduced = reduced_inertia(draw, j);
  const double damping_ratio = draw.rng.log_uniform(0.01, 0.1);
  const auto damping = [=](double s) { return 2.0 * damping_ratio * std::sqrt(reduced / s); };
  h.start = 1.0 / stiffness_at(15.0, reduced);
  h.limit = 1.0 / stiffness_at(7.0, reduced);
  h.add_parts = [j](double, const Robot& robot, Additions& parts) {
    parts.rotors.push_back(j);
    const std::string joint = robot.links[static_cast<std::size_t>(j)].joint;
    parts.tendons.push_back({"twist", {{motor_joint(robot, j), 1.0}, {joint, -1.0}}});
  };
  h.configure = [=](double s, mjModel& m, const State& x) {
    free_rotor(m, x, j, rotor);
    const int t = mj_name2id(&m, mjOBJ_TENDON, "twist");
    m.tendon_stiffness[t] = 1.0 / s;
    m.tendon_damping[t] = damping(s);
  };
  h.parameters = [=](double s) {
    return Json{{"stiffness", 1.0 / s}, {"damping", damping(s)}, {"motor_inertia", rotor}};
  };
  return h;
}

/// No torque inside the gap; outside, a spring much stiffer than the motion is fast.
Mechanism backlash(int j, const Draw& draw) {
  Mechanism h;
  const double rotor = rotor_inertia(draw, j), reduced = reduced_inertia(draw, j);
  const double unit = draw.link(j).slide ? 0.1 : 1.0;
  const double frequency = draw.rng.uniform(80.0, 160.0);
  const double stiffness = stiffness_at(frequency, reduced);
  const double damping = 2.0 * 0.2 * stiffness / (kTurn * frequency);
  h.start = 0.01 * unit;
  h.limit = 0.08 * unit;
  h.add_parts = [j](double, const Robot&, Additions& parts) { parts.rotors.push_back(j); };
  h.configure = [=](double, mjModel& m, const State& x) { free_rotor(m, x, j, rotor); };
  h.force = [=](double s, const State& x, double* qfrc) {
    const double twist = x.motor_q[j] - x.q[j];
    const double wind_up = twist - std::clamp(twist, -0.5 * s, 0.5 * s);
    if (wind_up == 0.0) return;
    // The flanks push only; they do not hold each other.
    const double torque = stiffness * wind_up + damping * (x.motor_qd[j] - x.qd[j]);
    if (torque * wind_up < 0.0) return;
    qfrc[x.motor_dof[j]] -= torque;
    qfrc[x.dof[j]] += torque;
  };
  h.parameters = [=](double s) {
    return Json{{"gap", s}, {"stiffness", stiffness}, {"motor_inertia", rotor}};
  };
  return h;
}

void set_friction(mjModel& m, const char* tendon, double coulomb, double viscous) {
  const int t = mj_name2id(&m, mjOBJ_TENDON, tendon);
  m.tendon_damping[t] = viscous;
  m.tendon_frictionloss[t] = coulomb;
  m.tendon_solref_fri[mjNREF * t] = 2.0 * m.opt.timestep;
  m.tendon_solimp_fri[mjNIMP * t] = m.tendon_solimp_fri[mjNIMP * t + 1] = 0.99;
}

/// Torque of a shaft that turns at about the pair's speed, and the strength that shows 2 %.
double pair_torque(const Draw& draw, int i) { return std::max(draw.torque(i), draw.torque(i + 1)); }

/// MuJoCo's tendons as the cables' shafts: w± = q̇ᵢ ± ρ q̇ⱼ.
Mechanism cable_differential(int i, const Draw& draw) {
  Mechanism h;
  const double ratio = 1.0 / draw.rng.uniform(1.2, 2.2);
  const double viscous = draw.rng.uniform(0.0, 1.0) / draw.speed(i);
  h.start = 0.01 * pair_torque(draw, i);
  h.add_parts = [=](double, const Robot& robot, Additions& parts) {
    const std::string a = robot.links[static_cast<std::size_t>(i)].joint;
    const std::string b = robot.links[static_cast<std::size_t>(i + 1)].joint;
    parts.tendons.push_back({"plus", {{a, 1.0}, {b, ratio}}});
    parts.tendons.push_back({"minus", {{a, 1.0}, {b, -ratio}}});
  };
  h.configure = [=](double s, mjModel& m, const State&) {
    set_friction(m, "plus", s, s * viscous);
    set_friction(m, "minus", s, s * viscous);
  };
  h.parameters = [=](double s) {
    return Json{{"coulomb", s}, {"viscous", s * viscous}, {"ratio", ratio}};
  };
  return h;
}

/// A shaft that a stiff spring keeps at qᵢ + ρ qⱼ; its inertia is a body's, its friction a
/// tendon's.
Mechanism coupling(int i, const Draw& draw) {
  Mechanism h;
  const double ratio = draw.rng.sign() * draw.rng.uniform(0.5, 1.0);
  const double viscous = draw.rng.uniform(0.0, 1.0) / draw.speed(i);
  const double armature = draw.rng.uniform(0.3, 2.0) / draw.scales.acceleration[i];
  h.start = 0.01 * pair_torque(draw, i);
  h.add_parts = [=](double, const Robot& robot, Additions& parts) {
    const std::string a = robot.links[static_cast<std::size_t>(i)].joint;
    const std::string b = robot.links[static_cast<std::size_t>(i + 1)].joint;
    parts.shafts.push_back("shaft");
    parts.tendons.push_back({"belt", {{"shaft", 1.0}, {a, -1.0}, {b, -ratio}}});
    parts.tendons.push_back({"turn", {{a, 1.0}, {b, ratio}}});
  };
  h.configure = [=](double s, mjModel& m, const State&) {
    const int dof = m.jnt_dofadr[mj_name2id(&m, mjOBJ_JOINT, "shaft")];
    const int belt = mj_name2id(&m, mjOBJ_TENDON, "belt");
    m.dof_armature[dof] = s * armature;
    m.tendon_stiffness[belt] = stiffness_at(150.0, s * armature);
    m.tendon_damping[belt] = 2.0 * 0.7 * m.tendon_stiffness[belt] / (kTurn * 150.0);
    set_friction(m, "turn", s, s * viscous);
  };
  h.place = [=](const State& x) {
    const int id = mj_name2id(x.model, mjOBJ_JOINT, "shaft");
    x.data->qpos[x.model->jnt_qposadr[id]] = x.q[i] + ratio * x.q[i + 1];
    x.data->qvel[x.model->jnt_dofadr[id]] = x.qd[i] + ratio * x.qd[i + 1];
  };
  h.parameters = [=](double s) {
    return Json{
        {"armature", s * armature}, {"viscous", s * viscous}, {"coulomb", s}, {"ratio", ratio}};
  };
  return h;
}

}  // namespace

bool is_transmission(const std::string& effect) {
  return effect == "joint_elasticity" || effect == "backlash" ||
         effect == "cable_differential_friction" || effect == "transmission_coupling";
}

Mechanism transmission(const std::string& effect, int j, const Draw& draw) {
  const bool pair = effect == "cable_differential_friction" || effect == "transmission_coupling";
  Mechanism h = effect == "joint_elasticity"              ? elasticity(j, draw)
                : effect == "backlash"                    ? backlash(j, draw)
                : effect == "cable_differential_friction" ? cable_differential(j, draw)
                                                          : coupling(j, draw);
  h.effect = effect;
  h.where = pair ? draw.joint(j) + "," + draw.joint(j + 1) : draw.joint(j);
  h.joints = pair ? std::vector<int>{j, j + 1} : std::vector<int>{j};
  return h;
}

}  // namespace hidden
