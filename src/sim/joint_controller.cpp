#include "sim/joint_controller.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "model/falling.hpp"

namespace diffnea::sim {

JointController::JointController(const Model& nominal, const Model& robot,
                                 const ControllerOptions& options, const VecX<double>& q0)
    : nominal_(nominal), options_(options), tree_(make_tree(falling(nominal))) {
  if (joint_names(robot) != joint_names(nominal))
    throw ModelError(nominal.source + ": its joints are not those of the robot, " + robot.source);
  if (nominal.constraints.empty() != robot.constraints.empty()) {
    const bool open = robot.constraints.empty();
    const Model& tied = open ? nominal : robot;
    throw ModelError((open ? robot : nominal).source + ": it lacks constraint '" +
                     tied.constraints.front().name + "' of " + tied.source +
                     "; expected the loops of one robot in both");
  }
  if (!(options.control_rate > 0.0)) throw Error("controller: control_rate must be positive");
  if (!nominal.constraints.empty()) loop_.emplace("simulate", nominal);
  if (!options.gravity_compensation) tree_.gravity = {0, 0, 0};
  const std::vector<int> moving = moving_links(robot);
  limit_.resize(static_cast<long>(moving.size()));
  for (std::size_t j = 0; j < moving.size(); ++j) {
    passive_.push_back(robot.links[moving[j]].passive);
    limit_[j] = robot.links[moving[j]].limits.effort;
  }
  start(q0);
}

void JointController::start(const VecX<double>& q0) {
  gains_ = joint_gains(nominal_, options_, q0);
  last_qd_.resize(0);
}

const VecX<double>& JointController::torque(const VecX<double>& q, const VecX<double>& qd,
                                            const VecX<double>& desired_q,
                                            const VecX<double>& desired_qd) {
  failure_.clear();
  const auto at_drives = [&](const VecX<double>& tau) -> VecX<double> {
    if (!loop_) return tau;
    const VecX<double> out = loop_->at_drives(q, tau);
    if (out.size() > 0) return out;
    failure_ = "the loop is at a dead point, where the driven joints do not hold it (" +
               loop_->leads_text(q) + ")";
    return VecX<double>::Zero(tau.size());
  };
  const auto feedback = [&](long j) {
    return gains_.kp[j] * (desired_q[j] - q[j]) + gains_.kd[j] * (desired_qd[j] - qd[j]);
  };
  if (options_.law == ControlLaw::kComputedTorque) {
    if (last_qd_.size() == 0) last_qd_ = desired_qd;
    qdd_ = (desired_qd - last_qd_) * options_.control_rate;
    for (long j = 0; j < qdd_.size(); ++j) qdd_[j] = passive_[j] ? 0.0 : qdd_[j] + feedback(j);
    VecX<double> v = qd;
    if (loop_) loop_->follow(q, v, qdd_);  // followers do as the leading joints are to
    u_ = at_drives(rnea(tree_, VecIn<double>(q), VecIn<double>(v), VecIn<double>(qdd_), ws_));
    last_qd_ = desired_qd;
  } else {
    u_ = at_drives(gravity_torques(tree_, VecIn<double>(q), ws_));
    for (long j = 0; j < u_.size(); ++j) u_[j] += passive_[j] ? 0.0 : feedback(j);
  }
  saturated_ = false;
  for (long j = 0; j < u_.size(); ++j) {
    if (passive_[j]) u_[j] = 0.0;
    saturated_ |= std::abs(u_[j]) > limit_[j];
    u_[j] = std::clamp(u_[j], -limit_[j], limit_[j]);
  }
  return u_;
}

}  // namespace diffnea::sim
