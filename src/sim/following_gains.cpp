#include "sim/following_gains.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/extended_tree.hpp>

#include "core/decompositions.hpp"
#include "model/falling.hpp"
#include "sim/desired_motion.hpp"

namespace diffnea::sim {
namespace {

/// Error / motion, root mean square, that a joint is allowed: half of what is said by name.
constexpr double kMiss = 0.1;
/// Phase of the fastest loop from one sample to the next [rad]: torques are held and velocities
/// half a sample old, which takes ω T / 2 of the phase margin; the damping of 0.7 has 1.1 rad.
constexpr double kPhase = 0.2;

/// Torque that the motion takes of the robot beside what `known` has of it: gravity, or all.
RowMatX<double> feedback(const Model& robot, const DesiredMotion& m, const RowMatX<double>& known) {
  ExtendedTree truth = extend(robot, {0});
  truth.series.clear();  // drives, encoders and springs: small beside what is looked for
  std::erase_if(truth.effects, reads_time);
  return inverse_dynamics(truth, m.q, m.qd, m.qdd) - known;
}

double rms_about_mean(const VecX<double>& x) {
  return std::sqrt((x.array() - x.mean()).square().mean());
}

/// Gains of computed torque at which errors of the model, and friction that it lacks, accelerate
/// the leading joints by no more than kMiss allows.
void stiffen(const Model& robot, const Model& controller, const Trajectory& trajectory,
             const ControllerOptions& o, JointGains& gains) {
  const LoopMotion loop("simulate", robot);
  const DesiredMotion m = desired_motion(trajectory, joint_names(robot), &loop);
  Tree<double> known = make_tree(controller);
  if (!o.gravity_compensation) known.gravity = {0, 0, 0};
  const RowMatX<double> tau = feedback(robot, m, rnea_batch(known, m.q, m.qd, m.qdd));
  MassMatrixWorkspace<double, double> ws;
  RowMatX<double> qdd = RowMatX<double>::Zero(m.q.rows(), static_cast<long>(loop.leads().size()));
  for (long k = 0; k < m.q.rows(); ++k) {
    const VecX<double> q = m.q.row(k).transpose();
    const MatX<double> D = loop.lead_map(q),
                       inertia = D * mass_matrix<double, double>(known, q, ws) * D.transpose();
    qdd.row(k) = inertia.ldlt().solve(VecX<double>(D * tau.row(k).transpose())).transpose();
  }
  const double fastest = kPhase * o.control_rate;
  for (std::size_t i = 0; i < loop.leads().size(); ++i) {
    const int j = loop.leads()[i];
    const double size = rms_about_mean(m.q.col(j)),
                 wanted = std::sqrt(qdd.col(static_cast<long>(i)).squaredNorm() /
                                    static_cast<double>(qdd.rows())) /
                          (kMiss * size),
                 kp = std::min(wanted, fastest * fastest);
    if (!(size > 0.0) || !(kp > gains.kp[j])) continue;
    gains.kp[j] = kp;
    gains.kd[j] = 2.0 * o.damping * std::sqrt(kp);
  }
}

}  // namespace

JointGains following_gains(const Model& robot, const Model& controller,
                           const Trajectory& trajectory, const ControllerOptions& o,
                           const VecX<double>& q0) {
  JointGains gains = joint_gains(controller, o, q0);
  if (o.kp.size() > 0 || o.kd.size() > 0) return gains;
  if (o.law == ControlLaw::kComputedTorque && !robot.constraints.empty())
    stiffen(robot, controller, trajectory, o, gains);
  if (o.law != ControlLaw::kPd) return gains;
  require_no_constraints("simulate", robot);
  const DesiredMotion motion = desired_motion(trajectory, joint_names(robot), nullptr);
  RowMatX<double> known = RowMatX<double>::Zero(motion.q.rows(), motion.q.cols());
  if (o.gravity_compensation)
    known = rnea_batch(make_tree(falling(controller)), motion.q, known, known);
  const RowMatX<double> tau = feedback(falling(robot), motion, known);
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
