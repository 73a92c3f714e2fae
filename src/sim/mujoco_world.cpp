#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/sim/mujoco_world.hpp>

#include "sim/control_loop.hpp"
#include "sim/drives.hpp"
#include "sim/mujoco_ball.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea {
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

/// The four effects that MuJoCo has fields for: which one a spec fills.
using Field = mjtNum* mjModel::*;
Field dof_field(const std::string& effect) {
  static const std::map<std::string, Field> kFields{
      {"armature", &mjModel::dof_armature},
      {"coulomb_friction", &mjModel::dof_frictionloss},
      {"viscous_friction", &mjModel::dof_damping}};
  const auto it = kFields.find(effect);
  return it == kFields.end() ? nullptr : it->second;
}

class MujocoPlant : public sim::Plant {
 public:
  MujocoPlant(const std::string& mjcf, const Model& truth, const RecordOptions& options) {
    sim::MujocoFiles files;
    model_ = sim::compile_mujoco(mjcf, files, truth.source);
    mjModel& m = *model_;
    substeps_ = sim::substeps(options);
    m.opt.timestep = 1.0 / (options.control_rate * substeps_);
    // Semi-implicit Euler moves the robot half a step early: a quarter of a millisecond, which a
    // diagnosis finds.
    m.opt.integrator = mjINT_RK4;
    const Vec3<double>& g = truth.gravity;
    const double gravity[3] = {g.x, g.y, g.z};
    std::copy_n(gravity, 3, m.opt.gravity);
    for (const ModelLink& link : truth.links) apply(link);
    for (const EffectSpec& effect : truth.effects) apply(effect, truth);
    apply_gains();
    ball_ = sim::MujocoBall(m, truth);
    data_.reset(mj_makeData(&m));
    if (!data_) throw ModelError(truth.source + ": MuJoCo has no memory for it");
    mj_setConst(&m, data_.get());
    q_.resize(static_cast<long>(dof_.size()));
    qd_ = extra_ = q_;
    drives_ = sim::Drives(series_, static_cast<int>(dof_.size()));
    encoders_ = sim::Encoders(series_, static_cast<int>(dof_.size()));
  }

  void reset(const VecX<double>& reading) override {
    const VecX<double> q = encoders_.truth(reading);
    drives_.reset();
    mj_resetData(model_.get(), data_.get());
    for (std::size_t j = 0; j < dof_.size(); ++j) data_->qpos[qpos_[j]] = q[j];
    ball_.hang(*model_, *data_);
    mj_forward(model_.get(), data_.get());
    read_state();
  }
  VecX<double> q() const override { return encoders_.read(q_); }
  VecX<double> qd() const override { return encoders_.read_velocity(qd_); }
  std::optional<Vec3<double>> ball() const override {
    if (!ball_.exists()) return {};
    return ball_.position(*data_);
  }

  std::string step(const VecX<double>& torque) override {
    drives_.command(data_->time, torque);
    for (int i = 0; i < substeps_; ++i) {
      extra_.setZero();
      JointSample<double> x;
      x.time = data_->time;
      x.q = q_.data();
      x.qd = qd_.data();
      x.qdd = x.tau = q_.data();  // unread: such effects were refused
      for (const BoundEffect& e : effects_) add_torque(e, x, e.parameters.data(), extra_.data());
      drives_.begin_step(data_->time, model_->opt.timestep);
      const VecX<double> applied = drives_.applied(0.5);
      for (std::size_t j = 0; j < dof_.size(); ++j)
        data_->qfrc_applied[dof_[j]] = (applied[j] - extra_[j]) / gains_[static_cast<long>(j)];
      drives_.end_step();
      mj_step(model_.get(), data_.get());
      read_state();
    }
    for (int w = 0; w < mjNWARNING; ++w)
      if (data_->warning[w].number > 0)
        return "MuJoCo warns: " +
               std::string(mju_warningText(w, static_cast<size_t>(data_->warning[w].lastinfo)));
    return "";
  }

 private:
  void apply(const ModelLink& link) {
    mjModel& m = *model_;
    // "wrist/yaw" is a link of its own in the tree, and one of several joints of the body in
    // MuJoCo.
    const std::size_t slash = link.name.rfind('/');
    const bool of_body = slash == link.name.npos || link.name.substr(slash + 1) != link.joint;
    Vec3<double> anchor;
    if (link.type != ModelJoint::kFixed) {
      const int joint = find(m, mjOBJ_JOINT, link.joint, "joint");
      qpos_.push_back(m.jnt_qposadr[joint]);
      dof_.push_back(m.jnt_dofadr[joint]);
      joint_.push_back(joint);
      anchor = {m.jnt_pos[3 * joint], m.jnt_pos[3 * joint + 1], m.jnt_pos[3 * joint + 2]};
      for (const Field field :
           {&mjModel::dof_armature, &mjModel::dof_damping, &mjModel::dof_frictionloss})
        (m.*field)[dof_.back()] = 0.0;
      m.jnt_stiffness[joint] = 0.0;
    }
    if (of_body)
      set_inertia(m, find(m, mjOBJ_BODY, link.name, "body"),
                  to_parent(Pose<double>{Mat3<double>::identity(), anchor}, link.inertia));
  }

  void apply(const EffectSpec& effect, const Model& truth) {
    mjModel& m = *model_;
    BoundEffect bound = bind(effect, truth);
    const EffectInfo& info = bound.info();
    if (const Field field = dof_field(info.name)) {
      for (const int j : bound.joints) (m.*field)[dof_[j]] += bound.parameters[0];
    } else if (info.name == "joint_spring") {
      for (const int j : bound.joints) {
        m.jnt_stiffness[joint_[j]] = bound.parameters[0];
        m.qpos_spring[qpos_[j]] = bound.parameters[1];
      }
    } else if (info.name == "torque_gain") {
      gain_effects_.push_back(std::move(bound));
    } else if (info.port == Port::kJointTorque && !reads_acceleration(bound)) {
      effects_.push_back(std::move(bound));
    } else if (info.name == "base_tilt") {
      for (int i = 0; i < 2; ++i) m.opt.gravity[i] += bound.parameters[static_cast<std::size_t>(i)];
    } else if (info.port == Port::kMeasurement || info.name.starts_with("actuator_") ||
               info.name == "saturation") {
      series_.push_back(std::move(bound));  // drives, encoders; the control loop has the rest
    } else {
      throw ModelError("MuJoCo world: effect '" + info.name + "' cannot act in MuJoCo");
    }
  }

  /// Drives that report 1 + ε times their torque: all that the recorded torque has beside the
  /// links' is in its unit (torque_gains).
  void apply_gains() {
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

  void read_state() {
    for (std::size_t j = 0; j < dof_.size(); ++j) {
      q_[j] = data_->qpos[qpos_[j]];
      qd_[j] = data_->qvel[dof_[j]];
    }
  }

  sim::MujocoModel model_;
  sim::MujocoData data_;
  sim::MujocoBall ball_;
  int substeps_ = 1;
  std::vector<int> joint_, qpos_, dof_;
  std::vector<BoundEffect> effects_, series_, gain_effects_;
  VecX<double> gains_;  ///< recorded over true torque
  sim::Drives drives_{{}, 0};
  sim::Encoders encoders_{{}, 0};
  VecX<double> q_, qd_, extra_;
};

void add_effect(Model& model, const char* name, const char* parameter, const ModelLink& link,
                double value, const char* unit, const char* unit_prismatic) {
  if (value == 0.0) return;
  for (EffectSpec& e : model.effects) {
    if (e.effect != name || e.where != link.joint) continue;
    for (EffectParameter& p : e.parameters)
      if (p.name == parameter) p.value += value;
    return;
  }
  model.effects.push_back(
      {name,
       link.joint,
       {{parameter, value, link.type == ModelJoint::kRevolute ? unit : unit_prismatic}}});
}

}  // namespace

Perturbation surrogate_a() {
  return {-0.08, 0.20, 0.10, 0.20, 0.015, 0.6, 1.5, 0.5, 1.2, 0.03, 0.1, 0.012, 0.008};
}
Perturbation surrogate_b() {
  return {-0.16, 0.40, 0.20, 0.40, 0.030, 1.2, 3.0, 1.0, 2.4, 0.06, 0.2, 0.024, 0.016};
}

Model perturbed(const Model& model, const Perturbation& p, std::uint64_t seed) {
  Model out = model;
  Rng rng(seed);
  const TreeMap map = map_to_tree(model);
  for (std::size_t i = 0; i < out.links.size(); ++i) {
    ModelLink& link = out.links[i];
    if (map.dof[i] < 0) continue;
    if (link.inertia.m > 0.0) {
      const double mass = link.inertia.m * (1.0 + rng.uniform(p.mass_low, p.mass_high));
      const double grow = 1.0 + rng.uniform(p.inertia_low, p.inertia_high);
      Vec3<double> shift{rng.normal(), rng.normal(), rng.normal()};
      shift = shift * (rng.uniform(0.0, p.com) / std::sqrt(dot(shift, shift)));
      const Sym3<double> I = inertia_about_com(link.inertia);
      link.inertia = inertia_from_com<double>(
          mass, link.inertia.h * (1.0 / link.inertia.m) + shift,
          {I.xx * grow, I.xy * grow, I.xz * grow, I.yy * grow, I.yz * grow, I.zz * grow});
    }
    if (link.type == ModelJoint::kFixed || link.passive) continue;
    const double scale = torque_scale(link);
    const double coulomb = scale * rng.uniform(p.coulomb_low, p.coulomb_high);
    const double viscous = scale * rng.uniform(p.viscous_low, p.viscous_high);
    const double armature = scale * rng.uniform(p.armature_low, p.armature_high);
    add_effect(out, "coulomb_friction", "coulomb", link, coulomb, "N*m", "N");
    add_effect(out, "viscous_friction", "viscous", link, viscous, "N*m*s/rad", "N*s/m");
    add_effect(out, "armature", "armature", link, armature, "kg*m^2", "kg");
  }
  if (out.ball && out.ball->string) {
    StringSpec& string = *out.ball->string;
    Vec3<double> shift{rng.normal(), rng.normal(), rng.normal()};
    shift = shift * (rng.uniform(0.0, p.attachment) / std::sqrt(dot(shift, shift)));
    string.p_LS = string.p_LS + shift;
    string.length += rng.uniform(-p.string, p.string);
  }
  return out;
}

SimulatedRecording averaged(const std::vector<SimulatedRecording>& repetitions) {
  if (repetitions.empty()) throw DataError("averaged: there is no recording");
  SimulatedRecording out = repetitions.front();
  Recording& mean = out.recording;
  long rows = mean.rows();
  for (const SimulatedRecording& r : repetitions) rows = std::min(rows, r.recording.rows());
  const auto average = [&](RowMatX<double> Recording::* channel) {
    RowMatX<double>& x = mean.*channel;
    if (x.size() == 0) return;
    x.conservativeResize(rows, x.cols());
    for (std::size_t k = 1; k < repetitions.size(); ++k) {
      const RowMatX<double>& other = repetitions[k].recording.*channel;
      require_size("averaged", other.cols(), x.cols(), "channel");
      x += other.topRows(rows);
    }
    x /= static_cast<double>(repetitions.size());
  };
  for (const auto channel :
       {&Recording::q, &Recording::qd, &Recording::qcmd, &Recording::tau, &Recording::ball})
    average(channel);
  mean.time.conservativeResize(rows);
  for (std::size_t k = 1; k < repetitions.size(); ++k) {
    out.saturated += repetitions[k].saturated;
    if (out.failure.empty()) out.failure = repetitions[k].failure;
  }
  return out;
}

SimulatedRecording record_in_mujoco(const std::string& mjcf, const Model& truth,
                                    const Model& controller, const Trajectory& trajectory,
                                    const RecordOptions& options) {
  MujocoPlant plant(mjcf, truth, options);
  SimulatedRecording out = sim::run_control_loop(plant, truth, controller, trajectory, options);
  out.recording.source = "MuJoCo: " + truth.source;
  return out;
}

}  // namespace diffnea
