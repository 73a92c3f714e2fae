#include <diffnea/core/error.hpp>
#include <diffnea/effects/forward_dynamics.hpp>

namespace diffnea {

ForwardDynamics::ForwardDynamics(ExtendedTree model)
    : model_(std::move(model)),
      n_(model_.tree.num_dofs()),
      tau_(n_),
      q_(n_),
      qd_(n_),
      effect_tau_(n_),
      dtau_dq_(n_, n_),
      dtau_dqd_(n_, n_) {
  aba_ws_.qdd.resize(n_);
  const auto refuse = [](const BoundEffect& e, const char* why) {
    throw ModelError("forward dynamics: " + e.info().name + " at '" + e.where + "' " + why);
  };
  for (const BoundEffect& e : model_.effects) {
    const std::string& name = e.info().name;
    if (name == "torque_gain" || name == "load_friction" || name == "transmission_coupling")
      refuse(e,
             "depends on the transmitted torque or the acceleration, which has no explicit forward "
             "form");
    if (name == "tip_force" || name == "warm_up") refuse(e, "has no forward form here");
  }
  for (const BoundEffect& e : model_.series)
    refuse(e,
           "depends on the past, or on how the motion is measured, and has no forward form here");
}

void ForwardDynamics::effect_torques(const double* q, const double* qd, int run, double* tau) {
  JointSample<double> x;
  x.run = run;
  x.q = q;
  x.qd = qd;
  x.qdd = q;  // unread: no explicit forward form reads q̈ or τ
  x.tau = q;
  for (const BoundEffect& e : model_.effects) add_torque(e, x, e.parameters.data(), tau);
}

void ForwardDynamics::acceleration(const double* q, const double* qd, const double* u, int run,
                                   double* qdd) {
  tau_.setZero();
  effect_torques(q, qd, run, tau_.data());
  for (int j = 0; j < n_; ++j) tau_[j] = u[j] - tau_[j];
  detail::aba(model_.tree, q, qd, tau_.data(), aba_ws_, qdd);
}

void ForwardDynamics::linearise(const double* q, const double* qd, const double* u, int run) {
  tau_.setZero();
  effect_torques(q, qd, run, tau_.data());
  for (int j = 0; j < n_; ++j) tau_[j] = u[j] - tau_[j];
  const Eigen::Map<const VecX<double>> q_map(q, n_), qd_map(qd, n_);
  aba_derivatives(model_.tree, q_map, qd_map, tau_, aba_);

  // ∂τ_effects/∂(q, q̇) by Jets. A joint's torque depends on that joint alone, or on the few an
  // effect couples: directions 2i and 2i+1 belong to the effect's i-th joint, all joints at once
  // where uncoupled.
  dtau_dq_.setZero();
  dtau_dqd_.setZero();
  for (int j = 0; j < n_; ++j) {
    q_[j] = JetD(q[j]);
    qd_[j] = JetD(qd[j]);
  }
  for (const BoundEffect& e : model_.effects) {
    const bool coupled = e.info().place == Place::kJointPair;
    for (std::size_t i = 0; i < e.joints.size(); ++i) {
      const std::size_t slot = coupled ? 2 * i : 0;
      q_[e.joints[i]].v[static_cast<long>(slot)] = 1.0;
      qd_[e.joints[i]].v[static_cast<long>(slot) + 1] = 1.0;
    }
    std::fill(effect_tau_.begin(), effect_tau_.end(), JetD(0.0));
    parameters_.clear();
    for (const double p : e.parameters) parameters_.emplace_back(p);
    const JointSample<JetD> x{0.0, run, q_.data(), qd_.data(), qd_.data(), qd_.data()};
    add_torque(e, x, parameters_.data(), effect_tau_.data());
    for (std::size_t i = 0; i < e.joints.size(); ++i) {
      const int row = e.joints[i];
      for (std::size_t k = 0; k < e.joints.size(); ++k) {
        if (!coupled && k != i) continue;
        const long slot = coupled ? 2 * static_cast<long>(k) : 0;
        dtau_dq_(row, e.joints[k]) += effect_tau_[row].v[slot];
        dtau_dqd_(row, e.joints[k]) += effect_tau_[row].v[slot + 1];
      }
    }
    for (const int j : e.joints) {
      q_[j].v.setZero();
      qd_[j].v.setZero();
    }
  }
  aba_.dqdd_dq.noalias() -= aba_.dqdd_dtau * dtau_dq_;
  aba_.dqdd_dqd.noalias() -= aba_.dqdd_dtau * dtau_dqd_;
}

}  // namespace diffnea
