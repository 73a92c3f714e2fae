#include "sim/following_gains.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/batch.hpp>
#include <diffnea/effects/extended_tree.hpp>

namespace diffnea::sim {
namespace {

/// Error / motion, root mean square, that a joint is allowed: half of what is said by name.
constexpr double kMiss = 0.1;
/// Phase of the fastest loop from one sample to the next [rad]: torques are held and velocities
/// half a sample old, which takes ω T / 2 of the phase margin; the damping of 0.7 has 1.1 rad.
constexpr double kPhase = 0.2;
/// Rows that are looked at; what a motion takes does not depend on more.
constexpr long kRows = 2000;

/// Positions, velocities and accelerations of all joints; 0 where none are desired.
struct Motion {
  RowMatX<double> q, qd, qdd;
};

Motion desired(const Trajectory& t, const std::vector<std::string>& joints) {
  const long step = std::max(1L, t.rows() / kRows), rows = (t.rows() + step - 1) / step;
  Motion out;
  out.q = RowMatX<double>::Zero(rows, static_cast<long>(joints.size()));
  out.qd = out.qdd = out.q;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto at = std::ranges::find(t.joint_names, joints[j]);
    if (at == t.joint_names.end()) continue;
    const long c = at - t.joint_names.begin();
    for (long k = 0; k < rows; ++k) {
      out.q(k, static_cast<long>(j)) = t.q(k * step, c);
      if (t.qd.size() > 0) out.qd(k, static_cast<long>(j)) = t.qd(k * step, c);
      if (t.qdd.size() > 0) out.qdd(k, static_cast<long>(j)) = t.qdd(k * step, c);
    }
  }
  return out;
}

/// Torque that the motion takes beside the compensation of gravity.
RowMatX<double> feedback(const Model& robot, const Model& controller, const Motion& m,
                         bool compensates) {
  require_plain_tree("simulate", robot);
  ExtendedTree truth = extend(robot, {0});
  truth.series.clear();  // drives, encoders and springs: small beside what is looked for
  std::erase_if(truth.effects, reads_time);
  RowMatX<double> tau = inverse_dynamics(truth, m.q, m.qd, m.qdd);
  if (!compensates) return tau;
  const RowMatX<double> still = RowMatX<double>::Zero(m.q.rows(), m.q.cols());
  return tau - rnea_batch(make_tree(controller), m.q, still, still);
}

double rms_about_mean(const VecX<double>& x) {
  return std::sqrt((x.array() - x.mean()).square().mean());
}

}  // namespace

JointGains following_gains(const Model& robot, const Model& controller,
                           const Trajectory& trajectory, const ControllerOptions& o,
                           const VecX<double>& q0) {
  JointGains gains = joint_gains(controller, o, q0);
  if (o.law != ControlLaw::kPd || o.kp.size() > 0 || o.kd.size() > 0) return gains;
  const Motion motion = desired(trajectory, joint_names(robot));
  const RowMatX<double> tau = feedback(robot, controller, motion, o.gravity_compensation);
  const VecX<double> inertia = joint_gains(robot, o, q0).kp / (o.bandwidth * o.bandwidth);
  const double fastest = kPhase * o.control_rate;
  for (long j = 0; j < gains.kp.size(); ++j) {
    const double size = rms_about_mean(motion.q.col(j)),
                 wanted = std::sqrt(tau.col(j).squaredNorm() / static_cast<double>(tau.rows())) /
                          (kMiss * size),
                 kp = std::min(wanted, inertia[j] * fastest * fastest);
    if (!(size > 0.0) || !(kp > gains.kp[j])) continue;
    gains.kp[j] = kp;
    gains.kd[j] = 2.0 * o.damping * std::sqrt(kp * inertia[j]);
  }
  return gains;
}

}  // namespace diffnea::sim
