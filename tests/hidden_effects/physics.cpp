#include "physics.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace hidden {
namespace {

/// Motion before the first row, so that the recording begins in the steady state [s].
constexpr double kLeadIn = 2.5;
/// A joint this far from its desired position is lost [rad]; [m] for a carriage.
constexpr double kLost = 0.7;
/// Postures along the motion in which the controller's inertias are looked up.
constexpr int kPostures = 50;

int joint_id(const mjModel& m, const std::string& name) {
  const int id = mj_name2id(&m, mjOBJ_JOINT, name.c_str());
  if (id < 0) throw std::runtime_error("no joint '" + name + "' in the simulated robot");
  return id;
}

/// The mechanisms' forces reach MuJoCo at every stage of its integrator through a callback without
/// user data.
struct Forces {
  const World* world = nullptr;
  State* state = nullptr;
  std::vector<int> qpos, motor_qpos;
};
thread_local Forces* active = nullptr;

void read_state(const mjData& d, const Forces& f) {
  State& s = *f.state;
  for (int j = 0; j < s.q.size(); ++j) {
    s.q[j] = d.qpos[f.qpos[j]];
    s.qd[j] = d.qvel[s.dof[j]];
    s.motor_q[j] = d.qpos[f.motor_qpos[j]];
    s.motor_qd[j] = d.qvel[s.motor_dof[j]];
  }
}

void passive_forces(const mjModel*, mjData* d) {
  if (!active) return;
  read_state(*d, *active);
  const World& world = *active->world;
  const State& s = *active->state;
  const Eigen::VectorXd friction = declared_friction(world.robot, s.qd, world.coulomb_width);
  for (int j = 0; j < s.q.size(); ++j) d->qfrc_passive[s.dof[j]] -= friction[j];
  for (const Mechanism& h : world.hidden)
    if (h.force) h.force(h.strength, s, d->qfrc_passive);
}

struct ActiveForces {
  explicit ActiveForces(Forces& f) {
    active = &f;
    mjcb_passive = passive_forces;
  }
  ~ActiveForces() { active = nullptr; }
};

}  // namespace

Model compile(const std::string& mjcf) {
  const auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  const char* name = "robot.xml";
  const int size = static_cast<int>(mjcf.size());
#if mjVERSION_HEADER >= 310
  mj_addBufferVFS(vfs.get(), name, mjcf.data(), size);
#else
  mj_makeEmptyFileVFS(vfs.get(), name, size);
  std::memcpy(vfs->filedata[mj_findFileVFS(vfs.get(), name)], mjcf.data(), mjcf.size());
#endif
  char message[1000] = "";
  Model model(mj_loadXML(name, vfs.get(), message, sizeof message));
  mj_deleteVFS(vfs.get());
  if (!model) throw std::runtime_error(std::string("MuJoCo: ") + message);
  return model;
}

Inverse::Inverse(const Robot& robot)
    : model_(compile(to_mjcf(robot, {}, false))), data_(mj_makeData(model_.get())) {}

Eigen::VectorXd Inverse::torque(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                const Eigen::VectorXd& qdd) {
  mjData* d = data_.get();
  const Eigen::Index n = q.size();
  std::copy_n(q.data(), n, d->qpos);
  std::copy_n(qd.data(), n, d->qvel);
  std::copy_n(qdd.data(), n, d->qacc);
  mj_kinematics(model_.get(), d);
  mj_comPos(model_.get(), d);
  mj_comVel(model_.get(), d);
  Eigen::VectorXd tau(n);
  mj_rne(model_.get(), d, 1, tau.data());
  for (Eigen::Index j = 0; j < n; ++j) tau[j] += model_->dof_armature[j] * qdd[j];
  return tau;
}

Eigen::VectorXd declared_friction(const Robot& robot, const Eigen::VectorXd& qd, double width) {
  Eigen::VectorXd out(qd.size());
  for (Eigen::Index j = 0; j < qd.size(); ++j) {
    const Link& link = robot.links[static_cast<std::size_t>(j)];
    const double v0 = link.slide ? 0.1 * width : width;
    out[j] = link.damping * qd[j] + link.coulomb * std::tanh(qd[j] / v0);
  }
  return out;
}

Series simulate(const World& world, const Motion& motion, const SimulationOptions& o) {
  const int n = world.robot.num_joints();
  Additions additions;
  for (const Mechanism& h : world.hidden)
    if (h.add_parts) h.add_parts(h.strength, world.robot, additions);
  const Model model = compile(to_mjcf(world.robot, additions, false));
  const Data data(mj_makeData(model.get()));
  mjModel& m = *model;
  mjData* d = data.get();

  State state;
  state.model = &m;
  state.data = d;
  state.time = 0.0;
  Forces forces{&world, &state, {}, {}};
  for (int j = 0; j < n; ++j) {
    const int id = joint_id(m, world.robot.links[static_cast<std::size_t>(j)].joint);
    const bool has_rotor = std::ranges::count(additions.rotors, j) > 0;
    const int motor = has_rotor ? joint_id(m, motor_joint(world.robot, j)) : id;
    state.dof.push_back(m.jnt_dofadr[id]);
    state.motor_dof.push_back(m.jnt_dofadr[motor]);
    forces.qpos.push_back(m.jnt_qposadr[id]);
    forces.motor_qpos.push_back(m.jnt_qposadr[motor]);
  }
  state.q = state.qd = state.motor_q = state.motor_qd = state.applied = Eigen::VectorXd::Zero(n);

  const int substeps =
      std::max(1, static_cast<int>(std::ceil(1.0 / (o.rate * o.physics_step) - 1e-9)));
  const double dt = 1.0 / (o.rate * substeps);
  m.opt.timestep = dt;
  m.opt.tolerance = 1e-12;
  for (const Mechanism& h : world.hidden) {
    if (h.configure) h.configure(h.strength, m, state);
    if (h.reset) h.reset();
  }
  mj_setConst(&m, d);

  // The controller: the nominal model's torque, and PD with the inertia that each joint feels while
  // the others move freely, 1/(M⁻¹)_jj: its mean over the motion, unless the sampled loop would be
  // unstable where it is least.
  Inverse reference(world.robot), model_seen(world.nominal);
  Eigen::VectorXd mean_inertia = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd least_inertia = Eigen::VectorXd::Constant(n, 1e9);
  mj_resetData(&m, d);
  for (int i = 0; i < kPostures; ++i) {
    for (int j = 0; j < n; ++j)
      d->qpos[forces.qpos[j]] = motion.position(j, i * motion.period() / kPostures);
    mj_forward(&m, d);
    for (int j = 0; j < n; ++j) {
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(m.nv, state.dof[j]);
      Eigen::VectorXd response(m.nv);
      mj_solveM(&m, d, response.data(), unit.data(), 1);
      double inertia = 1.0 / response[state.dof[j]];
      if (state.motor_dof[j] != state.dof[j]) inertia += m.dof_armature[state.motor_dof[j]];
      mean_inertia[j] += inertia / kPostures;
      least_inertia[j] = std::min(least_inertia[j], inertia);
    }
  }
  const Eigen::VectorXd inertia = mean_inertia.cwiseMin(4.0 * least_inertia);
  const Eigen::VectorXd kp = inertia * o.control_bandwidth * o.control_bandwidth;
  const Eigen::VectorXd kd = inertia * 2.0 * 0.8 * o.control_bandwidth;

  const long rows = std::lround(o.duration * o.rate) + 2 * kPad;
  Series out;
  out.time.resize(rows);
  for (Eigen::MatrixXd* matrix : {&out.q, &out.qd, &out.qcmd, &out.tau, &out.needed, &out.mean_q,
                                  &out.mean_qd, &out.mean_qdd})
    matrix->setZero(rows, n);

  const long lead = std::lround(kLeadIn * o.rate) + kPad;
  mj_resetData(&m, d);
  for (int j = 0; j < n; ++j) {
    const double begin = static_cast<double>(-lead) / o.rate;
    d->qpos[forces.motor_qpos[j]] = d->qpos[forces.qpos[j]] = motion.position(j, begin);
    d->qvel[state.motor_dof[j]] = d->qvel[state.dof[j]] = motion.velocity(j, begin);
  }
  read_state(*d, forces);
  for (const Mechanism& h : world.hidden)
    if (h.place) h.place(state);
  const ActiveForces installed(forces);
  for (long k = -lead; k < rows - kPad; ++k) {
    const double time = static_cast<double>(k) / o.rate;
    const long row = k + kPad;
    read_state(*d, forces);
    Eigen::VectorXd measured = state.motor_q, encoder_scale = Eigen::VectorXd::Ones(n),
                    encoder_offset = Eigen::VectorXd::Zero(n), command(n);
    for (const Mechanism& h : world.hidden)
      for (int j = 0; h.encoder && j < n; ++j) {
        const Encoder e = h.encoder(h.strength, j);
        encoder_scale[j] *= e.scale;
        encoder_offset[j] += e.offset;
      }
    measured = measured.cwiseProduct(encoder_scale) + encoder_offset;
    if (o.position_noise.rows() > 0 && row >= 0) measured += o.position_noise.row(row).transpose();
    Eigen::VectorXd desired_qd(n), desired_qdd(n);
    for (int j = 0; j < n; ++j) {
      desired_qd[j] = motion.velocity(j, time);
      desired_qdd[j] = motion.acceleration(j, time);
    }
    const Eigen::VectorXd feed_forward = model_seen.torque(measured, desired_qd, desired_qdd);
    for (int j = 0; j < n; ++j)
      command[j] = feed_forward[j] + kp[j] * (motion.position(j, time) - measured[j]) +
                   kd[j] * (desired_qd[j] - state.motor_qd[j]);
    if (row >= 0) {
      out.time[row] = time;
      out.q.row(row) = state.q;
      out.qd.row(row) = state.qd;
      out.tau.row(row) = command;
      for (int j = 0; j < n; ++j) out.qcmd(row, j) = motion.position(j, time);
    }

    for (int i = 0; i < substeps; ++i) {
      state.time = time + i * dt;
      state.applied = command;
      for (const Mechanism& h : world.hidden)
        for (int j = 0; h.drive && j < n; ++j)
          state.applied[j] = h.drive(h.strength, j, state.applied[j], dt);
      std::fill_n(d->qfrc_applied, m.nv, 0.0);
      for (int j = 0; j < n; ++j) d->qfrc_applied[state.motor_dof[j]] = state.applied[j];
      read_state(*d, forces);
      const Eigen::VectorXd q0 = state.q, qd0 = state.qd;
      mj_step(&m, d);
      read_state(*d, forces);
      for (const Mechanism& h : world.hidden)
        if (h.advance) h.advance(h.strength, state, dt);
      if (row < 0) continue;
      const Eigen::VectorXd q = (0.5 * (q0 + state.q)).cwiseProduct(encoder_scale) + encoder_offset;
      const Eigen::VectorXd qd = (0.5 * (qd0 + state.qd)).cwiseProduct(encoder_scale);
      const Eigen::VectorXd qdd = ((state.qd - qd0) / dt).cwiseProduct(encoder_scale);
      out.needed.row(row) +=
          (reference.torque(q, qd, qdd) + declared_friction(world.robot, qd, world.coulomb_width)) /
          substeps;
      out.mean_q.row(row) += q / substeps;
      out.mean_qd.row(row) += qd / substeps;
      out.mean_qdd.row(row) += qdd / substeps;
    }
    for (int j = 0; j < n; ++j) {
      const double lost =
          kLost * (world.robot.links[static_cast<std::size_t>(j)].slide ? 0.2 : 1.0);
      if (!(std::abs(state.q[j] - motion.position(j, time)) < lost))
        throw std::runtime_error("joint " + std::to_string(j + 1) +
                                 " left its motion at t = " + std::to_string(time) + " s");
    }
  }
  return out;
}

}  // namespace hidden
