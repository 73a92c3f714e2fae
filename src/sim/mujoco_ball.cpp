#include "sim/mujoco_ball.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Geometry>

namespace diffnea::sim {
namespace {

Eigen::Vector3d vector(const mjtNum* x) { return {x[0], x[1], x[2]}; }

}  // namespace

MujocoBall::MujocoBall(mjModel& m, const Model& truth) {
  body_ = mj_name2id(&m, mjOBJ_BODY, "ball");
  const bool chain = mj_name2id(&m, mjOBJ_JOINT, (std::string(kChain) + "0_x").c_str()) >= 0;
  for (int j = 0; chain && j < m.njnt; ++j)
    if (const char* name = mj_id2name(&m, mjOBJ_JOINT, j);
        name && std::string(name).starts_with(kChain))
      chain_.push_back(j);
  if (body_ >= 0 && m.body_jntnum[body_] == 1 && m.jnt_type[m.body_jntadr[body_]] == mjJNT_FREE)
    free_ = m.body_jntadr[body_];
  else if (!chain)
    body_ = -1;  // a link of the robot that is called so
  if (body_ < 0) return;
  if (truth.ball && truth.ball->mass > 0.0) {
    const double grow = truth.ball->mass / m.body_mass[body_];
    m.body_mass[body_] *= grow;
    for (int i = 0; i < 3; ++i) m.body_inertia[3 * body_ + i] *= grow;
  }
  if (const int tendon = mj_name2id(&m, mjOBJ_TENDON, "string"); tendon >= 0 && free_ >= 0)
    tie(m, truth, tendon);
}

void MujocoBall::tie(mjModel& m, const Model& truth, int tendon) {
  const int at = m.tendon_adr[tendon];
  if (m.tendon_num[tendon] != 2 || m.wrap_type[at] != mjWRAP_SITE) return;
  tendon_ = tendon;
  anchor_ = m.wrap_objid[at];
  end_ = m.wrap_objid[at + 1];
  if (m.site_bodyid[anchor_] == body_) std::swap(anchor_, end_);
  if (!truth.ball || !truth.ball->string) return;
  // The model's links have their origin at the joint, MuJoCo's bodies need not.
  const int body = m.site_bodyid[anchor_], joints = m.body_jntnum[body];
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  if (joints > 0) origin = vector(m.jnt_pos + 3 * (m.body_jntadr[body] + joints - 1));
  const Eigen::Vector3d p = to_eigen(truth.ball->string->p_LS) + origin;
  std::copy_n(p.data(), 3, m.site_pos + 3 * anchor_);
  m.site_sameframe[anchor_] = 0;  // compiled for where it was
  const double beside = (vector(m.site_pos + 3 * end_) - vector(m.body_ipos + 3 * body_)).norm();
  m.tendon_range[2 * tendon + 1] = truth.ball->string->length - beside;
}

void MujocoBall::hang(const mjModel& m, mjData& d) const {
  if (!exists()) return;
  mj_kinematics(&m, &d);
  const Eigen::Vector3d down = vector(m.opt.gravity).normalized();
  if (tendon_ >= 0) {
    const Eigen::Vector3d end =
        vector(d.site_xpos + 3 * anchor_) + down * m.tendon_range[2 * tendon_ + 1];
    // Upright, so that the site is where it is in the body.
    const Eigen::Vector3d origin = end - vector(m.site_pos + 3 * end_);
    mjtNum* q = d.qpos + m.jnt_qposadr[free_];
    std::copy_n(origin.data(), 3, q);
    q[3] = 1.0;
    q[4] = q[5] = q[6] = 0.0;
    std::fill_n(d.qvel + m.jnt_dofadr[free_], 6, 0.0);
  } else if (!chain_.empty()) {
    for (const int joint : chain_) {
      d.qpos[m.jnt_qposadr[joint]] = 0.0;
      d.qvel[m.jnt_dofadr[joint]] = 0.0;
    }
    const int joint = chain_.front(), body = m.jnt_bodyid[joint];
    // Rx(a) Ry(b) (−z) = (−sin b, sin a cos b, −cos a cos b) in the frame before the two hinges.
    const mjtNum* quat = d.xquat + 4 * m.body_parentid[body];
    const Eigen::Quaterniond parent(quat[0], quat[1], quat[2], quat[3]);
    const mjtNum* own = m.body_quat + 4 * body;
    const Eigen::Quaterniond placed(own[0], own[1], own[2], own[3]);
    const Eigen::Vector3d u = (parent * placed).conjugate() * down;
    mjtNum* q = d.qpos + m.jnt_qposadr[joint];
    q[0] = std::atan2(u.y(), -u.z());
    q[1] = -std::asin(std::clamp(u.x(), -1.0, 1.0));
  }
}

Vec3<double> MujocoBall::position(const mjData& d) const {
  const mjtNum* x = d.xipos + 3 * body_;
  return {x[0], x[1], x[2]};
}

Vec3<double> MujocoBall::velocity(const mjModel& m, const mjData& d) const {
  mjtNum V[6];  // about the centre of mass, axes of the world
  mj_objectVelocity(&m, &d, mjOBJ_BODY, body_, V, /*flg_local=*/0);
  return {V[3], V[4], V[5]};
}

}  // namespace diffnea::sim
