#include "sim/model_plant.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/hidden_motor.hpp>

#include "core/decompositions.hpp"

namespace diffnea::sim {

namespace {

std::optional<LoopMotion> loop_of(const Model* model) {
  if (!model || model->constraints.empty()) return std::nullopt;
  return LoopMotion("simulate", *model);
}

/// Tells whether an effect reads the torque that a joint transmits, and no acceleration: behind a
/// hidden motor that is its gear's, which the state tells.
bool reads_load(const BoundEffect& e) {
  return e.info().has(Trait::kFollowsLoad) || e.info().has(Trait::kGain);
}

}  // namespace

/// After a step of `h` seconds at constant velocity.
double ModelPlant::JointState::advanced(double way, double h) const {
  return h > 0.0 ? advanced_state(*effect, state, {way, way / h, h}) : state;
}

double ModelPlant::JointState::torque(double at, double velocity) const {
  return share * state_torque(*effect, at, velocity);
}

/// Rotors behind springs and gaps leave the tree.
void ModelPlant::hide_motors(Tree<double>& tree) {
  for (const BoundEffect& e : series_) {
    if (!hides_motor(e)) continue;
    const bool encoder = encoder_at_motor(e);
    for (std::size_t k = 0; k < e.joints.size(); ++k) {
      const int j = e.joints[k];
      double& armature = tree.links[static_cast<std::size_t>(e.links[k])].armature;
      const double inertia = encoder ? armature : motor_spring(e).inertia;
      if (encoder && !(inertia > 0.0))
        throw ModelError("simulate: " + e.info().name + " at '" + e.where +
                         "': the joint has no armature, which an encoder at the motor needs");
      if (!(inertia > 0.0)) continue;  // without a rotor nothing moves behind the spring
      if (std::ranges::find(motors_, j, &Motor::joint) != motors_.end())
        throw ModelError(
            "simulate: " + e.info().name + " at '" + e.where +
            "': the joint has a hidden motor already; one elasticity or backlash a joint");
      motors_.push_back({&e, j, inertia, armature - inertia, encoder});
      armature = 0.0;
    }
  }
}

void ModelPlant::place_states() {
  for (const BoundEffect& e : series_) {
    if (!has_state(e)) continue;
    for (const int j : e.joints) {
      const auto motor = std::ranges::find(motors_, j, &Motor::joint);
      const double share = motor == motors_.end()
                               ? 0.0
                               : motor_share(e.info(), motor_spring(*motor->effect).friction_share);
      if (share > 0.0) states_.push_back({&e, j, static_cast<int>(motor - motors_.begin()), share});
      if (share < 1.0) states_.push_back({&e, j, -1, 1.0 - share});
    }
  }
}

/// Moves out of the model what a step treats by itself.
ExtendedTree ModelPlant::take_apart(ExtendedTree model) {
  series_ = std::move(model.series);
  model.series.clear();
  for (const BoundEffect& e : series_)
    if (!is_simulated(e))
      throw ModelError(
          "simulate: " + e.info().name + " at '" + e.where +
          "' is not integrated here, and would be left out; leave it out of the model");
  hide_motors(model.tree);
  place_states();
  std::vector<BoundEffect> at_links;
  MotorShares shares(static_cast<std::size_t>(n_), -1.0);
  for (const Motor& m : motors_)
    shares[static_cast<std::size_t>(m.joint)] = motor_spring(*m.effect).friction_share;
  take_servos(model.effects);
  for (const BoundEffect& whole : model.effects)
    for (const BoundEffect& e : parts_at_motors(whole, shares)) {
      const double share = share_at_motors(e, shares);
      if (share > 0.0 && reads_acceleration(e) && !reads_load(e))
        throw ModelError(
            "simulate: " + e.info().name + " at '" + e.where +
            "' cannot act at a joint with elasticity or backlash; leave one of them out");
      if (share > 0.0) motor_effects_.push_back(scaled(e, share));
      if (share < 1.0) at_links.push_back(scaled(e, 1.0 - share));
    }
  model.effects = std::move(at_links);
  return model;
}

/// Moves drives that read commands, and the other parts of their laws.
void ModelPlant::take_servos(std::vector<BoundEffect>& effects) {
  const auto of_law = [](const BoundEffect& e) {
    return e.info().has(Trait::kReadsCommand) || e.info().has(Trait::kOfServo);
  };
  for (const BoundEffect& e : effects) {
    if (!of_law(e)) continue;
    std::vector<BoundEffect>& to = e.info().has(Trait::kReadsCommand) ? servos_ : laws_;
    to.push_back(e);
    for (const int j : e.joints) {
      to.back().encoders.push_back(n_ + j);
      if (e.info().has(Trait::kIntegrates)) integrated_.push_back(j);
    }
  }
  std::erase_if(effects, of_law);
  for (std::size_t i = 0; i < integrated_.size(); ++i)
    for (const BoundEffect& e : servos_)
      if (std::ranges::find(e.joints, integrated_[i]) != e.joints.end()) {
        integrators_.push_back(e);
        integrators_.back().joints = {n_ + static_cast<int>(i)};
        integrators_.back().encoders = {n_ + integrated_[i]};
      }
}

int ModelPlant::position_of(const JointState& b) const {
  return b.motor < 0 ? b.joint : 2 * n_ + b.motor;
}

int ModelPlant::velocity_of(const JointState& b) const {
  return b.motor < 0 ? n_ + b.joint : 2 * n_ + static_cast<int>(motors_.size()) + b.motor;
}

VecX<double> ModelPlant::at_encoders(const VecX<double>& z, int order) const {
  const int m = static_cast<int>(motors_.size());
  VecX<double> out = z.segment(order * n_, n_);
  for (int k = 0; k < m; ++k)
    if (const Motor& motor = motors_[static_cast<std::size_t>(k)]; motor.encoder)
      out[motor.joint] = z[2 * n_ + order * m + k];
  return out;
}

ModelPlant::ModelPlant(const Model& model, const RecordOptions& options)
    : ModelPlant(extend(model, {0}), 1.0 / options.control_rate, options.physics_step, 0, &model) {}

ModelPlant::ModelPlant(ExtendedTree model, double period, double largest_step, int run)
    : ModelPlant(std::move(model), period, largest_step, run, nullptr) {}

ModelPlant::ModelPlant(ExtendedTree model, double period, double largest_step, int run,
                       const Model* described)
    : n_(model.tree.num_dofs()),
      loop_(loop_of(described)),
      dynamics_(take_apart(std::move(model)),
                loop_ ? loop_->constraints() : TreeConstraints<double>{}),
      drives_(series_, n_),
      encoders_(series_, n_),
      period_(period),
      largest_step_(largest_step),
      run_(run) {}

/// Steps of a control period so that the fastest spring is followed, up to 200: beyond, the
/// integration fails and says so.
int ModelPlant::steps_for_stiffness(const VecX<double>& q) const {
  MassMatrixWorkspace<double, double> ws;
  const ExtendedTree& model = dynamics_.model();
  const MatX<double> M = mass_matrix<double, double>(model.tree, q, ws);
  const VecX<double> mobility =
      loop_ ? loop_->mobility(q, M) : VecX<double>(M.inverse().diagonal());
  double rate = 0.0;  // [1/s], of an oscillation or a decay
  const auto spring = [&](double stiffness, double damping, double inverse_inertia) {
    rate = std::max({rate, std::sqrt(stiffness * inverse_inertia), damping * inverse_inertia});
  };
  for (const Motor& m : motors_) {
    const MotorSpring<double> s = motor_spring(*m.effect);
    spring(s.stiffness, s.damping, mobility[m.joint] + 1.0 / m.inertia);
  }
  for (const BoundEffect& e : servos_)
    for (const int j : e.joints) {
      const auto motor = std::ranges::find(motors_, j, &Motor::joint);
      spring(e.parameters[0], e.parameters[1],
             motor == motors_.end() ? mobility[j] : 1.0 / motor->inertia);
    }
  for (const JointState& b : states_) {
    const AtRest<double> s = at_rest(*b.effect);
    const double inverse_inertia =
        b.motor < 0 ? mobility[b.joint] : 1.0 / motors_[static_cast<std::size_t>(b.motor)].inertia;
    spring(b.share * s.stiffness, b.share * s.damping, inverse_inertia);
  }
  const double asked = std::max(1.0, period_ / largest_step_);
  const double wanted = std::min(std::max(asked, 2.0 * period_ * rate), std::max(asked, 200.0));
  return static_cast<int>(std::ceil((wanted > asked ? wanted : asked) - 1e-9));
}

/// Steps of a control period so that Runge–Kutta stays stable where dry friction is steepest, at
/// rest.
int ModelPlant::steps_for_friction(const VecX<double>& q) {
  constexpr double kSpeed = 1e-5;   // [rad/s] or [m/s]: within any smoothing
  constexpr double kMaxRate = 2.0;  // h·λ, stable to 2.7
  constexpr double kMostSteps = 50.0;
  const VecX<double> rest = VecX<double>::Zero(n_);
  RneaWorkspace<double, double> ws;
  const VecX<double> load = gravity_torques<double, double>(dynamics_.model().tree, q, ws);
  VecX<double> qd = rest, plus(n_), minus(n_), sum = rest, motor = rest;
  for (int j = 0; j < n_; ++j) {
    const auto at = [&](double speed, VecX<double>& qdd) {
      qd[j] = speed;
      dynamics_.acceleration(q.data(), qd.data(), rest.data(), run_, qdd.data());
      motor.setZero();
      const JointSample<double> x{time_, run_, q.data(), qd.data(), q.data(), load.data()};
      for (const BoundEffect& e : motor_effects_)
        add_torque(e, x, e.parameters.data(), motor.data());
      for (const Motor& m : motors_)
        if (m.joint == j) qdd[j] -= motor[j] / m.inertia;
    };
    at(kSpeed, plus);
    at(-kSpeed, minus);
    qd[j] = 0.0;
    sum += (plus - minus).cwiseAbs() / (2.0 * kSpeed);
  }
  const double steps = std::ceil(period_ * sum.maxCoeff() / kMaxRate);
  return steps >= 1.0 ? static_cast<int>(std::min(steps, kMostSteps)) : 1;
}

void ModelPlant::start(const JointSeries& x, const RowMatX<double>& torque, long row) {
  constexpr double kMemory = 0.5;  // [s] that states and drives look back
  const int m = static_cast<int>(motors_.size());
  z_ = VecX<double>::Zero(2 * n_ + 2 * m + std::ssize(integrated_));
  const RowMatX<double> gain = encoders_.read_velocity(VecX<double>::Ones(n_)).transpose();
  RowMatX<double> q(3, n_), qd(3, n_), qdd(3, n_);
  VecX<double> time(3);
  for (long k = 0; k < 3; ++k) {
    time[k] = x.start + static_cast<double>(row - 1 + k) * x.dt;
    q.row(k) = encoders_.truth(x.q.row(row - 1 + k).transpose()).transpose();
    qd.row(k) = x.qd.row(row - 1 + k).cwiseQuotient(gain);
    qdd.row(k) = x.qdd.row(row - 1 + k).cwiseQuotient(gain);
  }
  z_.head(n_) = q.row(1).transpose();
  z_.segment(n_, n_) = qd.row(1).transpose();
  const long first = std::max(0L, row - std::lround(kMemory / x.dt));
  RowMatX<double> on_links = RowMatX<double>::Zero(3, n_);  // torque of states
  for (JointState& b : states_) {
    JointState at = b;
    at.state = 0.0;
    for (long k = first; k <= row + 1; ++k) {
      if (k > first)
        at.state = at.advanced((x.q(k, b.joint) - x.q(k - 1, b.joint)) / gain(0, b.joint), x.dt);
      if (k == row) b.state = at.state;
      if (const long beside = k - row + 1; b.motor < 0 && beside >= 0)
        on_links(beside, b.joint) += at.torque(at.state, qd(beside, b.joint));
    }
  }
  if (m > 0) {
    const RowMatX<double> load =
        inverse_dynamics(dynamics_.model(), q, qd, qdd, run_, &time) + on_links;
    for (int k = 0; k < m; ++k) {
      const Motor& motor = motors_[static_cast<std::size_t>(k)];
      const int j = motor.joint;
      const double wound = deflection_at(*motor.effect, load(1, j));
      const double rate =
          (deflection_at(*motor.effect, load(2, j)) - deflection_at(*motor.effect, load(0, j))) /
          (2.0 * x.dt);
      z_[2 * n_ + k] = q(1, j) + (motor.encoder ? 0.0 : wound);
      z_[2 * n_ + m + k] = qd(1, j) + (motor.encoder ? 0.0 : rate);
      if (!motor.encoder) continue;  // read is the motor; the link is behind it
      z_[j] -= wound;
      z_[n_ + j] -= rate;
    }
  }
  drives_.reset();
  for (long k = first; k < row; ++k) {
    time_ = x.start + static_cast<double>(k) * x.dt;
    drives_.command(time_, torque.row(k).transpose());
    drives_.begin_step(time_, x.dt);
    drives_.end_step();
  }
  time_ = x.start + static_cast<double>(row) * x.dt;
  substeps_ = std::max(steps_for_stiffness(z_.head(n_)), steps_for_friction(z_.head(n_)));
  step_ = period_ / substeps_;
}

void ModelPlant::reset(const VecX<double>& reading) {
  const VecX<double> read = encoders_.truth(reading);
  const int m = static_cast<int>(motors_.size());
  z_ = VecX<double>::Zero(2 * n_ + 2 * m + std::ssize(integrated_));
  VecX<double> q = read;
  // Springs hold the links against gravity: hidden motors start beyond them, links whose motors are
  // read behind these.
  RneaWorkspace<double, double> ws;
  const int rounds = std::ranges::any_of(motors_, &Motor::encoder) ? 5 : 1;
  for (int round = 0; round < rounds; ++round) {
    VecX<double> hold = gravity_torques<double, double>(dynamics_.model().tree, q, ws);
    if (loop_) hold = loop_->at_drives(q, hold);
    for (int k = 0; k < m; ++k) {
      const Motor& motor = motors_[static_cast<std::size_t>(k)];
      const double wound = deflection_at(*motor.effect, hold[motor.joint]);
      if (motor.encoder) q[motor.joint] = read[motor.joint] - wound;
      z_[2 * n_ + k] = read[motor.joint] + (motor.encoder ? 0.0 : wound);
    }
    // Encoders that are off, and links behind their motors, take the followers along.
    if (loop_) loop_->close(loop_->positions_of_leads(q), q);
  }
  z_.head(n_) = q;
  for (JointState& b : states_) b.state = 0.0;
  drives_.reset();
  time_ = 0.0;
  substeps_ = steps_for_stiffness(q);
  step_ = period_ / substeps_;
}

void ModelPlant::slope(double share, const VecX<double>& z, VecX<double>& dz) {
  const int m = static_cast<int>(motors_.size());
  const double h = share * step_;
  dz.setZero(z.size());
  dz.head(n_) = z.segment(n_, n_);
  VecX<double> q = z.head(n_), qd = z.segment(n_, n_);
  VecX<double> load = VecX<double>::Zero(n_);  // torque that gears transmit
  for (int k = 0; k < m; ++k) {  // where the motors are
    const Motor& motor = motors_[static_cast<std::size_t>(k)];
    const int j = motor.joint;
    q[j] = z[2 * n_ + k];
    qd[j] = z[2 * n_ + m + k];
    load[j] = transmitted(*motor.effect, q[j] - z[j], qd[j] - z[n_ + j]);
  }
  VecX<double> at_motors = VecX<double>::Zero(n_), at_links = at_motors;  // torque of effects
  for (const JointState& b : states_) {
    const int at = position_of(b);
    (b.motor < 0 ? at_links : at_motors)[b.joint] +=
        b.torque(b.advanced(z[at] - start_[at], h), z[velocity_of(b)]);
  }
  const JointSample<double> x{time_ + h, run_, q.data(), qd.data(), q.data(), load.data()};
  for (const BoundEffect& e : motor_effects_)
    add_torque(e, x, e.parameters.data(), at_motors.data());
  if (commands_) {
    VecX<double> both(2 * n_);  // angles, and what encoders read of them
    both << q, encoders_.read(at_encoders(z, 0));
    JointSample<double> led = x;
    const long sums = std::ssize(integrated_);
    VecX<double> rates(n_ + sums), torques = VecX<double>::Zero(n_ + sums);
    rates << qd, z.tail(sums);
    led.q = both.data();
    led.qd = rates.data();
    led.command = &*commands_;
    led.step = {time_, time_ + step_};
    for (const std::vector<BoundEffect>* list : {&servos_, &laws_, &integrators_})
      for (const BoundEffect& e : *list) add_torque(e, led, e.parameters.data(), torques.data());
    at_motors += torques.head(n_);
    dz.tail(sums) = -torques.tail(sums);
  }
  const VecX<double> torque = drives_.applied(share) - at_motors;

  at_links = torque - at_links;
  for (const Motor& motor : motors_)
    at_links[motor.joint] += load[motor.joint] - torque[motor.joint];
  dynamics_.set_time(time_ + h);
  dynamics_.acceleration(z.data(), z.data() + n_, at_links.data(), run_, dz.data() + n_);
  for (int k = 0; k < m; ++k) {
    const Motor& motor = motors_[static_cast<std::size_t>(k)];
    const int j = motor.joint;
    dz[2 * n_ + k] = qd[j];
    dz[2 * n_ + m + k] = (torque[j] - load[j] - motor.shared_armature * dz[n_ + j]) / motor.inertia;
  }
}

void ModelPlant::follow(CommandPath commands) {
  commands.add_copies(integrated_);
  for (std::size_t i = 0; i < integrated_.size(); ++i)
    commands.set_integrator(integrated_[i], n_ + static_cast<int>(i));
  for (const std::vector<BoundEffect>* list : {&servos_, &laws_})
    for (const BoundEffect& e : *list) lead_command(e, commands);
  commands_ = std::move(commands);
}

std::string ModelPlant::step(const VecX<double>& torque) {
  drives_.command(time_, torque);
  const double begin = time_;
  for (int i = 0; i < substeps_; ++i) {
    time_ = begin + i * step_;
    drives_.begin_step(time_, step_);
    start_ = z_;
    integrator_.step(
        [&](double share, const VecX<double>& z, VecX<double>& dz) { slope(share, z, dz); }, step_,
        z_);
    for (JointState& b : states_)
      b.state = b.advanced(z_[position_of(b)] - start_[position_of(b)], step_);
    drives_.end_step();
    if (!z_.allFinite()) return "the integration is unstable";
  }
  time_ = begin + period_;
  return loop_ ? close_loops() : "";
}

std::string ModelPlant::close_loops() {
  VecX<double> q = z_.head(n_), qd = z_.segment(n_, n_);
  if (!loop_->hold(q, qd)) return "constraint " + loop_->gap_text(q) + ", the loop has opened";
  z_.head(n_) = q;
  z_.segment(n_, n_) = qd;
  return "";
}

}  // namespace diffnea::sim
