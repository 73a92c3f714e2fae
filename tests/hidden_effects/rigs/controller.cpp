#include "controller.hpp"

#include <cmath>
#include <numbers>

namespace rigs {

using Eigen::Index;
using Eigen::VectorXd;

Controller::Controller(const Rig& rig, const VectorXd& middle)
    : rig_(rig), model_(rig.controller), sum_(VectorXd::Zero(middle.size())) {
  model_.evaluate(middle, sum_);
  inertia_ = model_.inertia().diagonal();
  for (Index j = 0; j < inertia_.size(); ++j)
    inertia_[j] += rig.controller.joints[static_cast<std::size_t>(j)].rotor;
}

VectorXd Controller::torque(const VectorXd& position, const Desired& wanted) {
  const Control& c = rig_.control;
  const double dt = 1.0 / c.rate;
  const Index n = position.size();
  VectorXd q(n);
  for (Index j = 0; j < n; ++j) q[j] = c.resolution * std::round(position[j] / c.resolution);
  if (before_.size() == 0) {
    before_ = q;
    speed_ = wanted.qd;
  }
  const double keep = std::exp(-2.0 * std::numbers::pi * c.velocity_filter * dt);
  speed_ = keep * speed_ + (1.0 - keep) * (q - before_) / dt;
  before_ = q;
  const VectorXd error = wanted.q - q;
  VectorXd out;
  if (c.computed_torque) {
    const double w = c.bandwidth;
    const VectorXd push = wanted.qdd + 1.8 * w * (wanted.qd - speed_) + w * w * error;
    out = model_.torque(q, speed_, push);
    for (Index j = 0; j < n; ++j)
      out[j] += rig_.controller.joints[static_cast<std::size_t>(j)].rotor * push[j];
  } else {
    const VectorXd slip = c.bandwidth * error + wanted.qd - speed_;
    const double fast = 2.5 * c.bandwidth;
    sum_ += 0.3 * c.bandwidth * dt * slip;
    out = fast * inertia_.cwiseProduct(slip + sum_);
    if (c.knows_gravity) {
      model_.evaluate(q, VectorXd::Zero(n));
      out += model_.bias();
    }
  }
  for (Index j = 0; j < n; ++j)
    if (rig_.arm.joints[static_cast<std::size_t>(j)].passive) out[j] = 0.0;
  return out;
}

}  // namespace rigs
