#include "sim/model_plant.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea::sim {
namespace {

bool acts_on(const BoundEffect& e, int joint) {
  return std::ranges::find(e.joints, joint) != e.joints.end();
}

/// Effects that pull at the link itself, before its spring or gap.
bool pulls_at_link(const BoundEffect& e) {
  return std::holds_alternative<JointSpring>(e.type) || std::holds_alternative<TipForce>(e.type);
}

}  // namespace

/// Bristles over a step of `h` seconds at constant velocity: exact, so that no stiffness makes them
/// unstable.
double ModelPlant::Bristles::advanced(double travel, double h) const {
  if (!(h > 0.0)) return state;
  const double* p = effect->parameters.data();
  return std::holds_alternative<PreslidingDahl>(effect->type)
             ? PreslidingDahl::advance(state, travel, p[1])
             : PreslidingLugre::advance(state, travel / h, h, p);
}

double ModelPlant::Bristles::torque(double at, double velocity) const {
  const double* p = effect->parameters.data();
  return std::holds_alternative<PreslidingDahl>(effect->type)
             ? p[0] * at
             : PreslidingLugre::torque(at, velocity, p);
}

double ModelPlant::Motor::transmitted(double deflection, double velocity) const {
  const double* p = effect->parameters.data();
  if (std::holds_alternative<JointElasticity>(effect->type))
    return p[0] * deflection + p[1] * velocity;
  return Backlash::transmitted(deflection, velocity, p);
}

/// Moves out of the model what a step treats by itself.
ExtendedTree ModelPlant::take_apart(ExtendedTree model) {
  series_ = std::move(model.series);
  model.series.clear();
  for (const BoundEffect& e : series_) {
    const bool elastic = std::holds_alternative<JointElasticity>(e.type);
    if (std::holds_alternative<PreslidingDahl>(e.type) ||
        std::holds_alternative<PreslidingLugre>(e.type))
      for (const int j : e.joints) bristles_.push_back({&e, j, 0.0});
    if (!elastic && !std::holds_alternative<Backlash>(e.type)) continue;
    for (const int j : e.joints) {
      if (!(e.parameters[2] > 0.0)) continue;  // without a rotor nothing moves behind the spring
      if (std::ranges::find(motors_, j, &Motor::joint) != motors_.end())
        throw ModelError(
            "simulate: " + e.info().name + " at '" + e.where +
            "': the joint has a hidden motor already; one elasticity or backlash a joint");
      double& armature = model.tree.links[static_cast<std::size_t>(j)].armature;
      motors_.push_back({&e, j, e.parameters[2], armature - e.parameters[2]});
      armature = 0.0;
    }
  }
  const auto at_motor = [&](const BoundEffect& e) {
    return !pulls_at_link(e) &&
           std::ranges::any_of(motors_, [&](const Motor& m) { return acts_on(e, m.joint); });
  };
  for (const BoundEffect& e : model.effects) {
    if (!at_motor(e)) continue;
    if (reads_acceleration(e))
      throw ModelError(
          "simulate: " + e.info().name + " at '" + e.where +
          "' cannot act at a joint with elasticity or backlash; leave one of them out");
    motor_effects_.push_back(e);
  }
  std::erase_if(model.effects, at_motor);
  return model;
}

ModelPlant::ModelPlant(const Model& model, const RecordOptions& options)
    : n_(static_cast<int>(moving_links(model).size())),
      dynamics_(take_apart(extend(model, {0}))),
      drives_(series_, n_),
      encoders_(series_, n_),
      period_(1.0 / options.control_rate),
      largest_step_(options.physics_step) {}

/// Steps of a control period so that the fastest spring is followed, up to 200: beyond, the
/// integration fails and says so.
int ModelPlant::steps_for_stiffness(const VecX<double>& q) const {
  MassMatrixWorkspace<double, double> ws;
  const ExtendedTree& model = dynamics_.model();
  const VecX<double> mobility =
      MatX<double>(mass_matrix<double, double>(model.tree, q, ws)).inverse().diagonal();
  double rate = 0.0;  // [1/s], of an oscillation or a decay
  const auto spring = [&](double stiffness, double damping, double inverse_inertia) {
    rate = std::max({rate, std::sqrt(stiffness * inverse_inertia), damping * inverse_inertia});
  };
  for (const Motor& m : motors_) {
    const std::vector<double>& p = m.effect->parameters;
    const bool elastic = std::holds_alternative<JointElasticity>(m.effect->type);
    spring(elastic ? p[0] : p[1], elastic ? p[1] : 0.0, mobility[m.joint] + 1.0 / m.inertia);
  }
  for (const Bristles& b : bristles_) {
    const std::vector<double>& p = b.effect->parameters;
    const bool dahl = std::holds_alternative<PreslidingDahl>(b.effect->type);
    double inverse_inertia = mobility[b.joint];
    for (const Motor& m : motors_)
      if (m.joint == b.joint) inverse_inertia = 1.0 / m.inertia;
    spring(dahl ? p[0] / p[1] : p[0], dahl ? 0.0 : p[1], inverse_inertia);
  }
  const double asked = std::max(1.0, period_ / largest_step_);
  const double wanted = std::min(std::max(asked, 2.0 * period_ * rate), std::max(asked, 200.0));
  return static_cast<int>(std::ceil((wanted > asked ? wanted : asked) - 1e-9));
}

void ModelPlant::reset(const VecX<double>& reading) {
  const VecX<double> q = encoders_.truth(reading);
  const int m = static_cast<int>(motors_.size());
  z_ = VecX<double>::Zero(2 * n_ + 2 * m);
  z_.head(n_) = q;
  // Hidden motors start where their springs hold the links against gravity.
  RneaWorkspace<double, double> ws;
  const VecX<double> hold = gravity_torques<double, double>(dynamics_.model().tree, q, ws);
  for (int k = 0; k < m; ++k) {
    const Motor& motor = motors_[static_cast<std::size_t>(k)];
    const double load = hold[motor.joint];
    const std::vector<double>& p = motor.effect->parameters;
    z_[2 * n_ + k] = q[motor.joint] + (std::holds_alternative<JointElasticity>(motor.effect->type)
                                           ? load / p[0]
                                           : Backlash::deflection_at(load, p.data()));
  }
  for (Bristles& b : bristles_) b.state = 0.0;
  drives_.reset();
  time_ = 0.0;
  substeps_ = steps_for_stiffness(q);
  step_ = period_ / substeps_;
}

void ModelPlant::slope(double share, const VecX<double>& z, VecX<double>& dz) {
  const int m = static_cast<int>(motors_.size());
  const double h = share * step_;
  dz.resize(z.size());
  dz.head(n_) = z.segment(n_, n_);
  VecX<double> q = z.head(n_), qd = z.segment(n_, n_), from = start_.head(n_);
  for (int k = 0; k < m; ++k) {  // where the motors are
    const int j = motors_[static_cast<std::size_t>(k)].joint;
    q[j] = z[2 * n_ + k];
    qd[j] = z[2 * n_ + m + k];
    from[j] = start_[2 * n_ + k];
  }
  VecX<double> torque = drives_.applied(share), effects = VecX<double>::Zero(n_);
  for (const Bristles& b : bristles_)
    effects[b.joint] += b.torque(b.advanced(q[b.joint] - from[b.joint], h), qd[b.joint]);
  const JointSample<double> x{time_ + h, 0, q.data(), qd.data(), q.data(), q.data()};
  for (const BoundEffect& e : motor_effects_) add_torque(e, x, e.parameters.data(), effects.data());
  torque -= effects;

  VecX<double> at_links = torque;
  for (int k = 0; k < m; ++k) {
    const Motor& motor = motors_[static_cast<std::size_t>(k)];
    const int j = motor.joint;
    at_links[j] = motor.transmitted(q[j] - z[j], qd[j] - z[n_ + j]);
  }
  dynamics_.set_time(time_ + h);
  dynamics_.acceleration(z.data(), z.data() + n_, at_links.data(), 0, dz.data() + n_);
  for (int k = 0; k < m; ++k) {
    const Motor& motor = motors_[static_cast<std::size_t>(k)];
    const int j = motor.joint;
    dz[2 * n_ + k] = qd[j];
    dz[2 * n_ + m + k] =
        (torque[j] - at_links[j] - motor.shared_armature * dz[n_ + j]) / motor.inertia;
  }
}

std::string ModelPlant::step(const VecX<double>& torque) {
  const int m = static_cast<int>(motors_.size());
  drives_.command(time_, torque);
  const double begin = time_;
  for (int i = 0; i < substeps_; ++i) {
    time_ = begin + i * step_;
    drives_.begin_step(time_, step_);
    start_ = z_;
    integrator_.step(
        [&](double share, const VecX<double>& z, VecX<double>& dz) { slope(share, z, dz); }, step_,
        z_);
    for (Bristles& b : bristles_) {
      int at = b.joint;
      for (int k = 0; k < m; ++k)
        if (motors_[static_cast<std::size_t>(k)].joint == b.joint) at = 2 * n_ + k;
      b.state = b.advanced(z_[at] - start_[at], step_);
    }
    drives_.end_step();
    if (!z_.allFinite()) return "the integration is unstable";
  }
  time_ = begin + period_;
  return "";
}

}  // namespace diffnea::sim
