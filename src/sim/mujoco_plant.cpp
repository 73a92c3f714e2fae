#include "sim/mujoco_plant.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <Eigen/Geometry>

#include <diffnea/core/error.hpp>

#include "core/decompositions.hpp"
#include "sim/rotor_names.hpp"

namespace diffnea::sim {
namespace {

/// By name; `body3`, `joint2`: by MuJoCo's number, as io/ names what has no name.
int find(const mjModel& m, mjtObj type, const std::string& name, const std::string& unnamed) {
  if (const int id = mj_name2id(&m, type, name.c_str()); id >= 0) return id;
  int id = -1;
  const int count = type == mjOBJ_BODY ? m.nbody : m.njnt;
  if (name.starts_with(unnamed))
    std::from_chars(name.data() + unnamed.size(), name.data() + name.size(), id);
  if (id < 0 || id >= count || mj_id2name(&m, type, id))
    throw ModelError("MuJoCo world: there is no " + unnamed + " '" + name + "' in the document");
  return id;
}

/// @param b  about the origin of the body
void set_inertia(mjModel& m, int body, const SpatialInertia<double>& b) {
  m.body_mass[body] = b.m;
  if (!(b.m > 0.0)) {
    std::fill_n(m.body_inertia + 3 * body, 3, 0.0);
    return;
  }
  const Vec3<double> com = b.h * (1.0 / b.m);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(to_eigen(full(inertia_about_com(b))));
  Eigen::Matrix3d R = eigen.eigenvectors();
  if (R.determinant() < 0) R.col(0) = -R.col(0);
  const Eigen::Quaterniond q(R);
  const double p[3] = {com.x, com.y, com.z}, quat[4] = {q.w(), q.x(), q.y(), q.z()};
  std::copy_n(p, 3, m.body_ipos + 3 * body);
  std::copy_n(quat, 4, m.body_iquat + 4 * body);
  std::copy_n(eigen.eigenvalues().data(), 3, m.body_inertia + 3 * body);
  m.body_sameframe[body] = 0;  // compiled for the inertia it had
}

/// MuJoCo's number of a degree of freedom that a parameter is; null: none.
using Field = mjtNum* mjModel::*;
Field dof_field(NativeField field) {
  switch (field) {
    case NativeField::kArmature:
      return &mjModel::dof_armature;
    case NativeField::kDamping:
      return &mjModel::dof_damping;
    case NativeField::kFrictionLoss:
      return &mjModel::dof_frictionloss;
    default:
      return nullptr;
  }
}

/// The native field of an effect's first parameter.
NativeField native_field(const BoundEffect& e) {
  return e.parameter_info.empty() ? NativeField::kNone : e.parameter_info.front().native;
}

}  // namespace

MujocoRobot::MujocoRobot(const std::string& mjcf, const Model& truth, double rate,
                         double largest_step) {
  MujocoFiles files;
  model_ = compile_mujoco(mjcf, files, truth.source);
  mjModel& m = *model_;
  substeps_ = std::max(1, static_cast<int>(std::ceil(1.0 / (rate * largest_step) - 1e-9)));
  m.opt.timestep = 1.0 / (rate * substeps_);
  // Semi-implicit Euler moves the robot half a step early: a quarter of a millisecond, which a
  // diagnosis finds.
  m.opt.integrator = mjINT_RK4;
  // Torques come from the controller: the document's own servos would hold the robot at zero.
  m.opt.disableflags |= mjDSBL_ACTUATION;
  const Vec3<double>& g = truth.gravity;
  const double gravity[3] = {g.x, g.y, g.z};
  std::copy_n(gravity, 3, m.opt.gravity);
  for (const ModelLink& link : truth.links) apply(link);
  if (truth.free_base) free_base(truth);
  tie_followers(truth);
  shares_.assign(dof_.size(), -1.0);
  for (const EffectSpec& effect : truth.effects)
    if (find_effect(effect.effect).motor == HiddenMotor::kSpring)
      tie_rotor(bind(effect, truth), truth);
  for (const EffectSpec& effect : truth.effects) apply(effect, truth);
  for (const Rotor& r : rotors_)
    m.dof_armature[dof_[r.joint]] =
        std::max(0.0, m.dof_armature[dof_[r.joint]] - m.dof_armature[r.dof]);
  apply_gains();
  cup_ = mj_name2id(&m, mjOBJ_SITE, "cup");
  place_cup(truth);
  ball_ = MujocoBall(m, truth);
  const MujocoData data(mj_makeData(&m));
  if (!data) throw ModelError(truth.source + ": MuJoCo has no memory for it");
  mj_setConst(&m, data.get());
  tie_loops(truth);  // which mj_setConst takes from q = 0
}

void MujocoRobot::apply(const ModelLink& link) {
  mjModel& m = *model_;
  // "wrist/yaw" is a link of its own in the tree, and one of several joints of the body in
  // MuJoCo.
  const std::size_t slash = link.name.rfind('/');
  const bool of_body = slash == link.name.npos || link.name.substr(slash + 1) != link.joint;
  Vec3<double> anchor;
  if (link.type != ModelJoint::kFixed) {
    const int joint = find(m, mjOBJ_JOINT, link.joint, "joint");
    if (!link.follows) {
      qpos_.push_back(m.jnt_qposadr[joint]);
      dof_.push_back(m.jnt_dofadr[joint]);
      joint_.push_back(joint);
    }
    anchor = {m.jnt_pos[3 * joint], m.jnt_pos[3 * joint + 1], m.jnt_pos[3 * joint + 2]};
    for (const Field field :
         {&mjModel::dof_armature, &mjModel::dof_damping, &mjModel::dof_frictionloss})
      (m.*field)[m.jnt_dofadr[joint]] = 0.0;
    m.jnt_stiffness[joint] = 0.0;
  }
  if (of_body)
    set_inertia(m, find(m, mjOBJ_BODY, link.name, "body"),
                to_parent(Pose<double>{Mat3<double>::identity(), anchor}, link.inertia));
}

/// The free joint of the base, which nothing brakes.
void MujocoRobot::free_base(const Model& truth) {
  mjModel& m = *model_;
  const std::string& name = truth.links[0].name;
  const int body = find(m, mjOBJ_BODY, name, "body"), joint = m.body_jntadr[body];
  if (joint < 0 || m.jnt_type[joint] != mjJNT_FREE)
    throw ModelError("MuJoCo world: '" + name +
                     "' floats in the model and not in the document; expected a freejoint");
  base_qpos_ = m.jnt_qposadr[joint];
  base_dof_ = m.jnt_dofadr[joint];
  for (const Field field :
       {&mjModel::dof_armature, &mjModel::dof_damping, &mjModel::dof_frictionloss})
    std::fill_n(m.*field + base_dof_, kBaseVelocities, 0.0);
}

MujocoRobot::Rotor* MujocoRobot::rotor_at(int joint) {
  const auto it = std::ranges::find(rotors_, joint, &Rotor::joint);
  return it == rotors_.end() ? nullptr : &*it;
}

void MujocoRobot::tie_rotor(const BoundEffect& elasticity, const Model& truth) {
  // Soft as MuJoCo's friction is by default, a rotor at rest would creep by 5 mrad/s.
  constexpr double kFrictionTime = 4e-3, kImpedance = 0.995;  // [s], of 0 … 1
  mjModel& m = *model_;
  const MotorSpring<double> held = motor_spring(elasticity);
  const std::string what = "MuJoCo world: " + elasticity.info().name + " at '";
  const std::vector<std::string> joints = joint_names(truth);
  const Tree<double> tree = make_tree(truth);
  for (std::size_t k = 0; k < elasticity.joints.size(); ++k) {
    const int j = elasticity.joints[k];
    const std::string& name = joints[static_cast<std::size_t>(j)];
    const int rotor = mj_name2id(&m, mjOBJ_JOINT, rotor_name(name).c_str()),
              spring = mj_name2id(&m, mjOBJ_TENDON, spring_name(name).c_str());
    if (rotor < 0 || spring < 0)
      throw ModelError(what + name + "': the document has no rotor there; with_rotors adds it");
    const bool encoder = encoder_at_motor(elasticity);
    const double inertia =
        encoder ? tree.links[static_cast<std::size_t>(elasticity.links[k])].armature : held.inertia;
    if (rotor_at(j) || !(inertia > 0.0))
      throw ModelError(what + name + "': one spring a joint, with a " +
                       (encoder ? "armature" : "motor_inertia") + " above 0");
    const int dof = m.jnt_dofadr[rotor];
    rotors_.push_back({j, m.jnt_qposadr[rotor], dof, held.stiffness, encoder});
    shares_[static_cast<std::size_t>(j)] = held.friction_share;
    m.tendon_stiffness[spring] = held.stiffness;
    m.tendon_damping[spring] = held.damping;
    m.tendon_lengthspring[spring] = 0.0;
    m.dof_armature[dof] = inertia;
    m.dof_solref[mjNREF * dof] = kFrictionTime;
    m.dof_solimp[mjNIMP * dof] = m.dof_solimp[mjNIMP * dof + 1] = kImpedance;
  }
}

/// A torque of position, velocity and time, by the side of the springs that it acts on.
void MujocoRobot::turn(const BoundEffect& effect) {
  for (const BoundEffect& e : parts_at_motors(effect, shares_)) {
    const double share = share_at_motors(e, shares_);
    Rotor* rotor = e.joints.empty() ? nullptr : rotor_at(e.joints.front());
    if (share > 0.0 && rotor && native_field(e) == NativeField::kStiction) {
      rotor->stiction = share * e.parameters[0];
      rotor->stribeck = e.parameters[1];
    } else if (share > 0.0) {
      rotor_effects_.push_back(scaled(e, share));
    }
    if (share < 1.0) effects_.push_back(scaled(e, 1.0 - share));
  }
}

/// By the side of the springs that it acts on.
void MujocoRobot::place_states(BoundEffect effect) {
  const auto& shared =
      state_effects_.emplace_back(std::make_shared<const BoundEffect>(std::move(effect)));
  for (const int j : shared->joints) {
    const Rotor* rotor = rotor_at(j);
    const double share =
        rotor ? motor_share(shared->info(), shares_[static_cast<std::size_t>(j)]) : 0.0;
    if (share > 0.0) states_.push_back({shared.get(), j, rotor->dof, share});
    if (share < 1.0) states_.push_back({shared.get(), j, dof_[j], 1.0 - share});
  }
}

void MujocoRobot::apply(const EffectSpec& effect, const Model& truth) {
  mjModel& m = *model_;
  BoundEffect bound = bind(effect, truth);
  const EffectInfo& info = bound.info();
  if (info.motor == HiddenMotor::kSpring) return;  // tied before
  if (!bound.follows.empty() && native_field(bound) != NativeField::kNone) {
    apply_to_follower(bound);
  } else if (const Field field = dof_field(native_field(bound))) {
    for (const int j : bound.joints) {
      const Rotor* rotor = info.has(Trait::kRotor) ? nullptr : rotor_at(j);
      const double share = rotor ? shares_[static_cast<std::size_t>(j)] : 0.0;
      (m.*field)[dof_[j]] += (1.0 - share) * bound.parameters[0];
      if (rotor) (m.*field)[rotor->dof] += share * bound.parameters[0];
    }
  } else if (native_field(bound) == NativeField::kStiffness) {
    for (const int j : bound.joints) {
      m.jnt_stiffness[joint_[j]] = bound.parameters[0];
      m.qpos_spring[qpos_[j]] = bound.parameters[1];
    }
  } else if (info.has(Trait::kGain) && rotors_.empty()) {
    gain_effects_.push_back(std::move(bound));
  } else if (info.port == Port::kJointTorque && !reads_acceleration(bound) &&
             !info.has(Trait::kOfServo)) {
    turn(bound);
  } else if (const auto delay = view_delay(bound)) {
    camera_delay_ += *delay;
    if (!(camera_delay_ >= 0.0))
      throw ModelError("MuJoCo world: " + info.name + ": the camera would see the ball " +
                       std::to_string(-camera_delay_) +
                       " s before it is there; expected 0 or more");
  } else if (info.has(Trait::kGravity)) {
    for (int i = 0; i < 2; ++i) m.opt.gravity[i] += bound.parameters[static_cast<std::size_t>(i)];
  } else if (has_state(bound)) {
    place_states(std::move(bound));
  } else if (info.port == Port::kMeasurement || is_of_drive_path(bound)) {
    series_.push_back(std::move(bound));  // drives, encoders; the control loop has the rest
  } else {
    throw ModelError("MuJoCo world: effect '" + info.name + "' cannot act in MuJoCo");
  }
}

/// Friction, rotor or spring of a joint that follows another.
void MujocoRobot::apply_to_follower(const BoundEffect& effect) {
  mjModel& m = *model_;
  const int joint = find(m, mjOBJ_JOINT, split_where(effect.where).place, "joint");
  if (const Field field = dof_field(native_field(effect))) {
    (m.*field)[m.jnt_dofadr[joint]] += effect.parameters[0];
  } else {
    m.jnt_stiffness[joint] = effect.parameters[0];
    m.qpos_spring[m.jnt_qposadr[joint]] = effect.parameters[1];
  }
}

/// Holds an equality as tightly as the steps allow: MuJoCo's own default gives way over 20 ms.
void MujocoRobot::stiffen(int equality) {
  constexpr double kImpedance = 0.9999;  // 1: rigid
  mjModel& m = *model_;
  m.eq_solref[mjNREF * equality] = 2.0 * m.opt.timestep;
  m.eq_solimp[mjNIMP * equality] = m.eq_solimp[mjNIMP * equality + 1] = kImpedance;
}

/// A frame of a link in MuJoCo's body: the link's origin is at the body's last joint.
std::pair<int, Pose<double>> MujocoRobot::in_body(const ConstraintEnd& end,
                                                  const Model& truth) const {
  if (end.link < 0) return {0, end.X_LF};
  const mjModel& m = *model_;
  const int body =
      find(m, mjOBJ_BODY, truth.links[static_cast<std::size_t>(end.link)].name, "body");
  Pose<double> X_BL = Pose<double>::identity();
  if (const int joints = m.body_jntnum[body]; joints > 0) {
    const mjtNum* p = m.jnt_pos + 3 * (m.body_jntadr[body] + joints - 1);
    X_BL.p = {p[0], p[1], p[2]};
  }
  return {body, X_BL * end.X_LF};
}

/// Closes loops where the model has them, and as tightly: between bodies MuJoCo would take the
/// second point from q = 0, wherever the sites of the file are.
/// @throws ModelError if the document lacks a constraint of the model
void MujocoRobot::tie_loops(const Model& truth) {
  mjModel& m = *model_;
  for (const ConstraintSpec& c : truth.constraints) {
    const bool weld = c.kind == ConstraintKind::kWeld;
    const int type = weld ? mjEQ_WELD : mjEQ_CONNECT;
    int e = mj_name2id(&m, mjOBJ_EQUALITY, c.name.c_str());
    for (int k = 0; k < m.neq && e < 0; ++k)  // names that io/ gives
      if (!mj_id2name(&m, mjOBJ_EQUALITY, k) &&
          c.name.starts_with((weld ? "weld" : "connect") + std::to_string(k + 1)))
        e = k;
    if (e < 0 || m.eq_type[e] != type)
      throw ModelError("MuJoCo world: constraint '" + c.name +
                       "' of the model is not in the document; expected a connect or weld of that "
                       "name");
    const auto [a, X_AJ] = in_body(c.first, truth);
    const auto [b, X_BK] = in_body(c.second, truth);
    m.eq_obj1id[e] = a;
    m.eq_obj2id[e] = b;
    mjtNum* data = m.eq_data + static_cast<std::ptrdiff_t>(mjNEQDATA) * e;
    const auto put = [](const Vec3<double>& p, mjtNum* to) {
      const double numbers[3] = {p.x, p.y, p.z};
      std::copy_n(numbers, 3, to);
    };
    if (weld) {  // x₁ + R₁ relpos = x₂ + R₂ anchor, R₁ relquat = R₂; the anchor leads
      const Eigen::Quaterniond q(to_eigen(X_AJ.R * transpose(X_BK.R)));
      const double quat[4] = {q.w(), q.x(), q.y(), q.z()};
      put(X_BK.p, data);
      put(X_AJ.p, data + 3);
      std::copy_n(quat, 4, data + 6);
    } else {
      put(X_AJ.p, data);
      put(X_BK.p, data + 3);
    }
    stiffen(e);
  }
}

void MujocoRobot::tie_followers(const Model& truth) {
  mjModel& m = *model_;
  for (const TreeJoint& j : tree_joints(truth)) {
    if (!j.follows) continue;
    const int joint = find(m, mjOBJ_JOINT, j.name, "joint");
    followers_.push_back({m.jnt_qposadr[joint], m.jnt_dofadr[joint], j.drive});
    bool tied = false;
    for (int e = 0; e < m.neq; ++e) {
      if (m.eq_type[e] != mjEQ_JOINT || (m.eq_obj1id[e] != joint && m.eq_obj2id[e] != joint))
        continue;
      tied = true;
      stiffen(e);
    }
    if (!tied)
      throw ModelError("MuJoCo world: joint '" + j.name +
                       "' follows another in the model, and moves alone in the document; expected "
                       "an <equality> of both joints");
  }
}

/// Drives that report 1 + ε times their torque: all that the recorded torque has beside the
/// links' is in its unit (torque_gains).
void MujocoRobot::apply_gains() {
  mjModel& m = *model_;
  gains_ = torque_gains(gain_effects_, static_cast<int>(dof_.size()));
  for (std::size_t j = 0; j < dof_.size(); ++j) {
    const double gain = gains_[static_cast<long>(j)];
    for (const Field field :
         {&mjModel::dof_armature, &mjModel::dof_damping, &mjModel::dof_frictionloss})
      (m.*field)[dof_[j]] /= gain;
    m.jnt_stiffness[joint_[j]] /= gain;
  }
}

/// A cup that is fixed to its link may be tilted in the truth (perturbed).
void MujocoRobot::place_cup(const Model& truth) {
  const auto frame = std::ranges::find(truth.frames, "cup", &ModelFrame::name);
  if (cup_ < 0 || frame == truth.frames.end() || frame->link < 0) return;
  const ModelLink& link = truth.links[frame->link];
  if (link.type != ModelJoint::kFixed) return;
  mjModel& m = *model_;
  const int body = find(m, mjOBJ_BODY, link.name, "body"), parent = m.body_parentid[body];
  // The model's links have their origin at the joint, MuJoCo's bodies need not.
  Eigen::Vector3d p = to_eigen(link.X_PJ.p);
  if (const int joints = m.body_jntnum[parent]; joints > 0)
    p += Eigen::Map<const Eigen::Vector3d>(m.jnt_pos + 3 * (m.body_jntadr[parent] + joints - 1));
  const Eigen::Quaterniond q(to_eigen(link.X_PJ.R));
  const double quat[4] = {q.w(), q.x(), q.y(), q.z()};
  std::copy_n(p.data(), 3, m.body_pos + 3 * body);
  std::copy_n(quat, 4, m.body_quat + 4 * body);
}

MujocoPlant::MujocoPlant(std::shared_ptr<const MujocoRobot> robot)
    : robot_(std::move(robot)),
      data_(mj_makeData(robot_->model_.get())),
      drives_(robot_->series_, static_cast<int>(robot_->dof_.size())),
      encoders_(robot_->series_, static_cast<int>(robot_->dof_.size())) {
  if (!data_) throw ModelError("MuJoCo world: there is no memory for its state");
  q_.setZero(static_cast<long>(robot_->dof_.size()));
  qd_ = extra_ = rotor_q_ = rotor_qd_ = q_;
  states_.resize(robot_->states_.size());
  const auto sticks = [](const MujocoRobot::Rotor& r) { return r.stiction > 0.0; };
  if (std::ranges::any_of(robot_->rotors_, sticks)) {
    own_.reset(mj_copyModel(nullptr, robot_->model_.get()));
    if (!own_) throw ModelError("MuJoCo world: there is no memory for a model of its own");
  }
}

/// Joints and rotors at rest, whatever acts forgets what was.
void MujocoPlant::place_joints(const VecX<double>& q) {
  drives_.reset();
  std::ranges::fill(states_, 0.0);
  mj_resetData(model(), data_.get());
  for (std::size_t j = 0; j < robot_->qpos_.size(); ++j) data_->qpos[robot_->qpos_[j]] = q[j];
  for (const MujocoRobot::Follower& f : robot_->followers_)
    data_->qpos[f.qpos] = f.drive.ratio * q[f.drive.dof] + f.drive.offset;
  for (const MujocoRobot::Rotor& r : robot_->rotors_) data_->qpos[r.qpos] = q[r.joint];
}

void MujocoPlant::launch(const VecX<double>& reading, const VecX<double>& velocity,
                         const Launch& thrown) {
  if (robot_->base_qpos_ < 0) Plant::launch(reading, velocity, thrown);  // throws
  place_joints(encoders_.truth(reading));
  const VecX<double> qd =
      velocity.cwiseQuotient(encoders_.read_velocity(VecX<double>::Ones(velocity.size())));
  for (std::size_t j = 0; j < robot_->dof_.size(); ++j) data_->qvel[robot_->dof_[j]] = qd[j];
  for (const MujocoRobot::Follower& f : robot_->followers_)
    data_->qvel[f.dof] = f.drive.ratio * qd[f.drive.dof];
  for (const MujocoRobot::Rotor& r : robot_->rotors_) data_->qvel[r.dof] = qd[r.joint];
  const Pose<double>& X = thrown.X_WB;
  const Eigen::Quaterniond q(to_eigen(X.R));
  const Vec3<double> v = X.R * thrown.V_WB_B.linear, &w = thrown.V_WB_B.angular;
  const double pose[kBasePositions] = {X.p.x, X.p.y, X.p.z, q.w(), q.x(), q.y(), q.z()},
               twist[kBaseVelocities] = {v.x, v.y, v.z, w.x, w.y, w.z};
  std::copy_n(pose, kBasePositions, data_->qpos + robot_->base_qpos_);
  std::copy_n(twist, kBaseVelocities, data_->qvel + robot_->base_dof_);
  mj_forward(model(), data_.get());
  read_state();
}

VecX<double> MujocoPlant::base() const {
  if (robot_->base_qpos_ < 0) return {};
  const mjtNum* x = data_->qpos + robot_->base_qpos_;
  return VecX<double>{{x[0], x[1], x[2], x[4], x[5], x[6], x[3]}};
}

void MujocoPlant::reset(const VecX<double>& reading) {
  const VecX<double> q = encoders_.truth(reading);
  place_joints(q);
  hang_ball();
  // Springs are wound up by what the links weigh; links whose motors are read, where that is so.
  const int rounds = std::ranges::any_of(robot_->rotors_, &MujocoRobot::Rotor::encoder) ? 5 : 1;
  for (int round = 0; round < rounds && !robot_->rotors_.empty(); ++round) {
    for (const MujocoRobot::Rotor& r : robot_->rotors_) {
      const auto j = static_cast<std::size_t>(r.joint);
      const double wound = data_->qfrc_bias[robot_->dof_[j]] / r.stiffness;
      if (r.encoder)
        data_->qpos[robot_->qpos_[j]] = q[r.joint] - wound;
      else
        data_->qpos[r.qpos] = q[r.joint] + wound;
    }
    mj_forward(model(), data_.get());
  }
  read_state();
}

VecX<double> MujocoPlant::q() const {
  VecX<double> seen = q_;
  for (const MujocoRobot::Rotor& r : robot_->rotors_)
    if (r.encoder) seen[r.joint] = data_->qpos[r.qpos];
  return encoders_.read(seen);
}

VecX<double> MujocoPlant::qd() const {
  VecX<double> seen = qd_;
  for (const MujocoRobot::Rotor& r : robot_->rotors_)
    if (r.encoder) seen[r.joint] = data_->qvel[r.dof];
  return encoders_.read_velocity(seen);
}

void MujocoPlant::hang_ball() {
  robot_->ball_.hang(*model(), *data_);
  mj_forward(model(), data_.get());
  read_state();
  shown_.clear();
  if (has_ball() && robot_->camera_delay_ > 0.0)
    shown_.push_back({robot_->ball_.position(*data_), {0.0, 0.0, 0.0}});
}

/// Hermite's cubic between two periods.
MujocoPlant::Seen MujocoPlant::seen() const {
  const double h = robot_->substeps_ * model()->opt.timestep;
  const double ago = std::min(robot_->camera_delay_ / h, static_cast<double>(shown_.size() - 1));
  const std::size_t k = static_cast<std::size_t>(std::ceil(ago));
  const Seen& a = shown_[shown_.size() - 1 - k];
  if (k == 0) return a;
  const Seen& b = shown_[shown_.size() - k];
  const double t = static_cast<double>(k) - ago, t2 = t * t, t3 = t2 * t;
  return {
      a.x * (2 * t3 - 3 * t2 + 1) + b.x * (3 * t2 - 2 * t3) + a.v * ((t3 - 2 * t2 + t) * h) +
          b.v * ((t3 - t2) * h),
      (a.x - b.x) * ((6 * t2 - 6 * t) / h) + a.v * (3 * t2 - 4 * t + 1) + b.v * (3 * t2 - 2 * t)};
}

std::optional<Vec3<double>> MujocoPlant::ball() const {
  if (!robot_->ball_.exists()) return {};
  return shown_.empty() ? robot_->ball_.position(*data_) : seen().x;
}

Vec3<double> MujocoPlant::ball_velocity() const {
  return shown_.empty() ? robot_->ball_.velocity(*model(), *data_) : seen().v;
}

/// Dry friction of the rotors, at their speeds.
void MujocoPlant::take_stiction() {
  for (const MujocoRobot::Rotor& r : robot_->rotors_) {
    if (!(r.stiction > 0.0)) continue;
    const double ratio = data_->qvel[r.dof] / r.stribeck;
    own_->dof_frictionloss[r.dof] =
        robot_->model_->dof_frictionloss[r.dof] + r.stiction * std::exp(-ratio * ratio);
  }
}

Pose<double> MujocoPlant::cup() const {
  const mjtNum *p = data_->site_xpos + 3 * robot_->cup_, *R = data_->site_xmat + 9 * robot_->cup_;
  Eigen::Matrix3d rows;
  rows << R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8];
  return {mat3<double>(rows), {p[0], p[1], p[2]}};
}

std::string MujocoPlant::step(const VecX<double>& torque) {
  const mjModel* m = model();
  drives_.command(data_->time, torque);
  for (int i = 0; i < robot_->substeps_; ++i) {
    extra_.setZero();
    JointSample<double> x;
    x.time = data_->time;
    x.q = q_.data();
    x.qd = qd_.data();
    x.qdd = x.tau = q_.data();  // unread: such effects were refused
    for (const BoundEffect& e : robot_->effects_)
      add_torque(e, x, e.parameters.data(), extra_.data());
    drives_.begin_step(data_->time, m->opt.timestep);
    const VecX<double> applied = drives_.applied(0.5);
    for (std::size_t j = 0; j < robot_->dof_.size(); ++j)
      data_->qfrc_applied[robot_->dof_[j]] =
          (applied[j] - extra_[j]) / robot_->gains_[static_cast<long>(j)];
    drives_.end_step();
    if (!robot_->rotors_.empty()) push_rotors(applied);
    hold_states();
    mj_step(m, data_.get());
    advance_states();
    read_state();
  }
  // A step leaves poses and velocities of bodies where its last evaluation had them.
  if (robot_->ball_.exists() || has_cup()) {
    mj_kinematics(m, data_.get());
    mj_comPos(m, data_.get());
    mj_comVel(m, data_.get());
  }
  if (!shown_.empty()) {
    shown_.push_back({robot_->ball_.position(*data_), robot_->ball_.velocity(*m, *data_)});
    const double kept = robot_->camera_delay_ / (robot_->substeps_ * m->opt.timestep) + 2.0;
    if (static_cast<double>(shown_.size()) > kept) shown_.pop_front();
  }
  for (int w = 0; w < mjNWARNING; ++w)
    if (data_->warning[w].number > 0)
      return "MuJoCo warns: " +
             std::string(mju_warningText(w, static_cast<size_t>(data_->warning[w].lastinfo)));
  return "";
}

/// Torque of the states in the middle of a step at the present velocity: a torque held from its
/// beginning would drive what it is to slow down.
void MujocoPlant::hold_states() {
  const double half = 0.5 * model()->opt.timestep;
  before_.resize(states_.size());
  for (std::size_t k = 0; k < states_.size(); ++k) {
    const MujocoRobot::JointState& s = robot_->states_[k];
    const double v = data_->qvel[s.dof];
    before_[k] = data_->qpos[model()->jnt_qposadr[model()->dof_jntid[s.dof]]];
    const double z = advanced_state(*s.effect, states_[k], {v * half, v, half});
    const double gain =
        s.dof == robot_->dof_[static_cast<std::size_t>(s.joint)] ? robot_->gains_[s.joint] : 1.0;
    data_->qfrc_applied[s.dof] -= s.share * state_torque(*s.effect, z, v) / gain;
  }
}

void MujocoPlant::advance_states() {
  const double h = model()->opt.timestep;
  for (std::size_t k = 0; k < states_.size(); ++k) {
    const MujocoRobot::JointState& s = robot_->states_[k];
    const double way = data_->qpos[model()->jnt_qposadr[model()->dof_jntid[s.dof]]] - before_[k];
    states_[k] = advanced_state(*s.effect, states_[k], {way, way / h, h});
  }
}

/// The drives' torque goes to the rotors where there are such.
void MujocoPlant::push_rotors(const VecX<double>& applied) {
  rotor_q_ = q_;
  rotor_qd_ = qd_;
  for (const MujocoRobot::Rotor& r : robot_->rotors_) {
    rotor_q_[r.joint] = data_->qpos[r.qpos];
    rotor_qd_[r.joint] = data_->qvel[r.dof];
  }
  VecX<double> torque = VecX<double>::Zero(q_.size());
  for (const MujocoRobot::Rotor& r : robot_->rotors_) {
    torque[r.joint] = -applied[r.joint];
    data_->qfrc_applied[robot_->dof_[r.joint]] -= applied[r.joint];
  }
  const JointSample<double> x{data_->time,      0,         rotor_q_.data(),
                              rotor_qd_.data(), q_.data(), q_.data()};
  for (const BoundEffect& e : robot_->rotor_effects_)
    add_torque(e, x, e.parameters.data(), torque.data());
  for (std::size_t j = 0; j < robot_->dof_.size(); ++j) {
    const auto rotor =
        std::ranges::find(robot_->rotors_, static_cast<int>(j), &MujocoRobot::Rotor::joint);
    const bool has = rotor != robot_->rotors_.end();
    if (has)
      data_->qfrc_applied[rotor->dof] = -torque[static_cast<long>(j)];
    else
      data_->qfrc_applied[robot_->dof_[j]] -= torque[static_cast<long>(j)];
  }
  take_stiction();
}

void MujocoPlant::read_state() {
  for (std::size_t j = 0; j < robot_->dof_.size(); ++j) {
    q_[j] = data_->qpos[robot_->qpos_[j]];
    qd_[j] = data_->qvel[robot_->dof_[j]];
  }
}

}  // namespace diffnea::sim
