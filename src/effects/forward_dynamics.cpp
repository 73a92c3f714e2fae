#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/stepping.hpp>
#include <diffnea/model/free_base.hpp>

#include "core/decompositions.hpp"

namespace diffnea {

bool reads_acceleration(const BoundEffect& e) { return e.info().has(Trait::kReadsAcceleration); }

VecX<double> torque_gains(const std::vector<BoundEffect>& effects, int num_dofs) {
  VecX<double> out = VecX<double>::Ones(num_dofs);
  for (const BoundEffect& e : effects)
    if (e.info().has(Trait::kGain))
      for (const int j : e.joints) out[j] += e.parameters[0];
  for (const BoundEffect& e : effects)
    if (e.info().has(Trait::kGain))
      for (const int j : e.joints)
        if (!(out[j] > 0.0))
          throw ModelError(
              "torque_gain at '" + e.where + "': gain_error = " + std::to_string(out[j] - 1.0) +
              ", expected above -1: recorded over true torque is 1 + gain_error; check "
              "the torque's sign");
  return out;
}

ForwardDynamics::ForwardDynamics(ExtendedTree model)
    : model_(std::move(model)),
      n_(model_.tree.num_dofs()),
      gains_(torque_gains(model_.effects, n_)),
      tau_(model_.tree.num_velocities()),
      q_(n_),
      qd_(n_),
      qdd_(n_),
      links_(n_),
      effect_tau_(n_),
      dtau_dq_(n_, n_),
      dtau_dqd_(n_, n_),
      implicit_tau_(n_),
      still_(VecX<double>::Zero(n_)),
      solution_(n_),
      by_qdd_(n_, n_),
      by_links_(n_, n_) {
  aba_ws_.qdd.resize(model_.tree.num_velocities());
  for (const BoundEffect& e : model_.series)
    throw ModelError("forward dynamics: " + e.info().name + " at '" + e.where +
                     "' depends on the past or on how the motion is measured, not on one instant; "
                     "`diffnea simulate` integrates it");
  std::erase_if(model_.effects, [](const BoundEffect& e) { return e.info().has(Trait::kGain); });
  for (int i = model_.tree.first_joint(); i < model_.tree.num_links(); ++i)
    model_.tree.links[i].armature /= gains_[model_.tree.drive(i).dof];
  for (std::size_t k = 0; k < model_.effects.size(); ++k) {
    const BoundEffect& e = model_.effects[k];
    Reads reads{joints_read(e)};
    reads.implicit = reads_acceleration(e);
    if (reads.implicit) implicit_.push_back(k);
    reads.coupled = e.info().place == Place::kJointPair || e.is_gear || reads.joints != e.joints;
    reads_.push_back(std::move(reads));
  }
  if (!model_.tree.free_base) return;
  for (const BoundEffect& e : model_.effects)
    if (reads_acceleration(e) || e.info().port != Port::kJointTorque)
      throw ModelError("forward dynamics: " + e.info().name + " at '" + e.where +
                       "' is not served on a robot that floats yet; --fix-base (fix_base=True) "
                       "reads the base as fixed where the file has it");
}

ForwardDynamics::ForwardDynamics(ExtendedTree model, TreeConstraints<double> constraints)
    : ForwardDynamics(std::move(model)) {
  constraints_ = std::move(constraints);
  if (constraints_.list.empty() || implicit_.empty()) return;
  const BoundEffect& e = model_.effects[implicit_.front()];
  throw ModelError("forward dynamics: " + e.info().name + " at '" + e.where +
                   "' reads the acceleration or the transmitted torque, which constraint '" +
                   constraints_.list.front().name +
                   "' changes, and is not served beside it; leave the effect out");
}

void ForwardDynamics::effect_torques(const double* q, const double* qd, int run, double* tau) {
  JointSample<double> x;
  x.time = time_;
  x.run = run;
  x.q = q;
  x.qd = qd;
  x.qdd = x.tau = q;  // unread: what reads them is implicit
  x.command = command_;
  x.step = step_;
  for (std::size_t k = 0; k < model_.effects.size(); ++k)
    if (const BoundEffect& e = model_.effects[k]; !reads_[k].implicit)
      add_torque(e, model_.tree, x, e.parameters.data(), tau);
}

/// Torque of one effect at the Jets that q_, qd_, qdd_ and links_ hold, into effect_tau_.
void ForwardDynamics::torque_by_jets(const BoundEffect& e, int run) {
  for (const int j : e.joints) effect_tau_[static_cast<std::size_t>(j)] = JetD(0.0);
  parameters_.clear();
  for (const double p : e.parameters) parameters_.emplace_back(p);
  const JointSample<JetD> x{time_,       run,           q_.data(), qd_.data(),
                            qdd_.data(), links_.data(), command_,  step_};
  add_torque(e, x, parameters_.data(), effect_tau_.data());
}

/// Adds E of one effect at q̈ and at the torque transmitted there, with ∂E/∂q̈ and ∂E/∂τ by Jets:
/// directions 2i and 2i+1 belong to the effect's i-th joint, all joints at once where uncoupled.
void ForwardDynamics::add_implicit(std::size_t effect, const double* qdd, int run) {
  const BoundEffect& e = model_.effects[effect];
  const auto& [reads, coupled, implicit] = reads_[effect];
  for (int j = 0; j < n_; ++j) {
    qdd_[j] = JetD(qdd[j]);
    links_[j] = JetD(transmitted_[j]);
  }
  for (std::size_t i = 0; i < reads.size(); ++i) {
    const long slot = coupled ? 2 * static_cast<long>(i) : 0;
    qdd_[reads[i]].v[slot] = 1.0;
    links_[reads[i]].v[slot + 1] = 1.0;
  }
  torque_by_jets(e, run);
  for (std::size_t i = 0; i < e.joints.size(); ++i) {
    const int row = e.joints[i];
    implicit_tau_[row] += effect_tau_[row].a;
    for (std::size_t k = 0; k < reads.size(); ++k) {
      if (!coupled && k != i) continue;
      const long slot = coupled ? 2 * static_cast<long>(k) : 0;
      by_qdd_(row, reads[k]) += effect_tau_[row].v[slot];
      by_links_(row, reads[k]) += effect_tau_[row].v[slot + 1];
    }
  }
}

/// M q̈ + c + E(q̈) = u by Newton's method, from the q̈ without the implicit effects E. E is linear in
/// q̈ and in the transmitted torque but for the signs of load friction, so two or three steps end
/// it. Leaves E, its slopes and S.
/// @param tau  what reaches the links less the explicit effects, (n)
void ForwardDynamics::solve_implicit(const double* q, const double* qd, const VecX<double>& tau,
                                     int run, double* qdd) {
  const Eigen::Map<const VecX<double>> q_map(q, n_), qd_map(qd, n_);
  mass_ = mass_matrix<double, double>(model_.tree, q_map, mass_ws_);
  bias_ = rnea<double, double>(model_.tree, q_map, qd_map, still_, rnea_ws_);
  links_mass_ = mass_;
  for (int j = 0; j < n_; ++j) links_mass_(j, j) -= model_.tree.armature(j);
  free_ = tau - bias_;
  Eigen::Map<VecX<double>> a(qdd, n_);
  a = mass_.llt().solve(free_);
  for (int j = 0; j < n_; ++j) {
    q_[j] = JetD(q[j]);
    qd_[j] = JetD(qd[j]);
  }
  for (int step = 0; step < 20; ++step) {
    transmitted_ = bias_;
    transmitted_.noalias() += links_mass_ * a;
    implicit_tau_.setZero();
    by_qdd_.setZero();
    by_links_.setZero();
    for (const std::size_t k : implicit_) add_implicit(k, qdd, run);
    slope_ = by_qdd_;
    slope_.noalias() += by_links_ * links_mass_;
    slope_ = mass_ + gains_.cwiseInverse().asDiagonal() * slope_;
    off_ = implicit_tau_.cwiseQuotient(gains_) - free_;
    off_.noalias() += mass_ * a;
    if (!(off_.cwiseAbs().maxCoeff() > 1e-10 * (1.0 + free_.cwiseAbs().maxCoeff()))) break;
    a -= slope_.partialPivLu().solve(off_);
  }
}

void ForwardDynamics::acceleration(const double* q, const double* qd, const double* u, int run,
                                   double* qdd) {
  const long base = tau_.size() - n_;  // numbers of a free base, which lead
  tau_.setZero();
  effect_torques(q + model_.tree.num_positions() - n_, qd + base, run, tau_.data() + base);
  for (long j = 0; j < base; ++j) tau_[j] = u[j];
  for (int j = 0; j < n_; ++j) tau_[base + j] = (u[base + j] - tau_[base + j]) / gains_[j];
  if (!constraints_.list.empty()) {
    using Map = Eigen::Map<const VecX<double>>;
    Eigen::Map<VecX<double>>(qdd, tau_.size()) = constrained_forward_dynamics<double, double>(
        model_.tree, constraints_, Map(q, model_.tree.num_positions()), Map(qd, tau_.size()), tau_,
        {}, constrained_ws_);
  } else if (implicit_.empty())
    detail::aba(model_.tree, q, qd, tau_.data(), aba_ws_, qdd);
  else
    solve_implicit(q, qd, tau_, run, qdd);
}

void ForwardDynamics::linearise(const double* q, const double* qd, const double* u, int run) {
  require_fixed_base("forward dynamics with effects, linearised", model_.tree);
  if (!constraints_.list.empty())
    throw ModelError("forward dynamics with effects, linearised: constraint '" +
                     constraints_.list.front().name + "' has no derivatives here");
  for (const BoundEffect& e : model_.effects)
    if (reads_time(e) || e.info().port == Port::kLinkForce)
      throw ModelError(
          "forward dynamics: " + e.info().name + " at '" + e.where +
          "' has no derivatives here, so the motion loss cannot have it; the inverse loss "
          "or `diffnea diagnose` can");
  // τ_effects and ∂τ_effects/∂(q, q̇) by Jets. A joint's torque depends on that joint alone, or on
  // the few an effect couples: directions 2i and 2i+1 belong to the effect's i-th joint, all joints
  // at once where uncoupled.
  dtau_dq_.setZero();
  dtau_dqd_.setZero();
  for (int j = 0; j < n_; ++j) {
    q_[j] = JetD(q[j]);
    qd_[j] = JetD(qd[j]);
  }
  const auto add_slopes = [&](std::size_t effect, double* torque) {
    const BoundEffect& e = model_.effects[effect];
    const auto& [reads, coupled, implicit] = reads_[effect];
    for (std::size_t i = 0; i < reads.size(); ++i) {
      const std::size_t slot = coupled ? 2 * i : 0;
      q_[reads[i]].v[static_cast<long>(slot)] = 1.0;
      qd_[reads[i]].v[static_cast<long>(slot) + 1] = 1.0;
    }
    torque_by_jets(e, run);
    for (std::size_t i = 0; i < e.joints.size(); ++i) {
      const int row = e.joints[i];
      if (torque) torque[row] += effect_tau_[row].a;
      for (std::size_t k = 0; k < reads.size(); ++k) {
        if (!coupled && k != i) continue;
        const long slot = coupled ? 2 * static_cast<long>(k) : 0;
        dtau_dq_(row, reads[k]) += effect_tau_[row].v[slot];
        dtau_dqd_(row, reads[k]) += effect_tau_[row].v[slot + 1];
      }
    }
    for (const int j : reads) {
      q_[j].v.setZero();
      qd_[j].v.setZero();
    }
  };
  tau_.setZero();
  for (std::size_t effect = 0; effect < model_.effects.size(); ++effect)
    if (!reads_[effect].implicit) add_slopes(effect, tau_.data());
  for (int j = 0; j < n_; ++j) tau_[j] = (u[j] - tau_[j]) / gains_[j];
  const Eigen::Map<const VecX<double>> q_map(q, n_), qd_map(qd, n_);
  if (is_implicit()) {
    solve_implicit(q, qd, tau_, run, solution_.data());
    tau_ -= implicit_tau_.cwiseQuotient(gains_);
    for (int j = 0; j < n_; ++j) {
      qdd_[j] = JetD(solution_[j]);
      links_[j] = JetD(transmitted_[j]);
    }
    for (const std::size_t effect : implicit_) add_slopes(effect, nullptr);
  }
  aba_derivatives(model_.tree, q_map, qd_map, tau_, aba_);
  dtau_dq_ = gains_.cwiseInverse().asDiagonal() * dtau_dq_;
  dtau_dqd_ = gains_.cwiseInverse().asDiagonal() * dtau_dqd_;
  if (!is_implicit()) {
    aba_.dqdd_dq.noalias() -= aba_.dqdd_dtau * dtau_dq_;
    aba_.dqdd_dqd.noalias() -= aba_.dqdd_dtau * dtau_dqd_;
    return;
  }
  // S ∂q̈ = −(1 + ∂E/∂τ) ∂(M q̈ + c) − ∂E, the latter two at this q̈.
  link_share_ = gains_.cwiseInverse().asDiagonal() * by_links_;
  link_share_.diagonal().array() += 1.0;
  aba_.dqdd_dtau = slope_.partialPivLu().inverse();
  dtau_dq_.noalias() += link_share_ * aba_.dtau_dq;
  dtau_dqd_.noalias() += link_share_ * aba_.dtau_dqd;
  aba_.dqdd_dq.noalias() = -aba_.dqdd_dtau * dtau_dq_;
  aba_.dqdd_dqd.noalias() = -aba_.dqdd_dtau * dtau_dqd_;
}

}  // namespace diffnea
