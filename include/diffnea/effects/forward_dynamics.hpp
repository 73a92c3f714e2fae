#pragma once
/// Forward dynamics of a model with its effects, and what simulation-based fits need of it: derivatives
/// with respect to state and to every linear parameter.

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/effects/extended_tree.hpp>

namespace diffnea {

/// q̈ = M⁻¹(u − c(q, q̇) − τ_effects(q, q̇)) with derivatives. Evaluates one state at a time; not thread-safe.
class ForwardDynamics {
 public:
  /// @throws ModelError if an effect needs q̈ or the transmitted torque (no explicit forward form here)
  explicit ForwardDynamics(ExtendedTree model);

  int num_dofs() const { return n_; }
  ExtendedTree& model() { return model_; }

  /// q̈ alone. @param q, qd, u  (n)  @param qdd  (n), written
  void acceleration(const double* q, const double* qd, const double* u, int run, double* qdd);

  /// Also ∂q̈/∂q, ∂q̈/∂q̇ and M⁻¹, effects included; read them from the accessors.
  void linearise(const double* q, const double* qd, const double* u, int run);
  const VecX<double>& qdd() const { return aba_.qdd; }
  const RowMatX<double>& dqdd_dq() const { return aba_.dqdd_dq; }
  const RowMatX<double>& dqdd_dqd() const { return aba_.dqdd_dqd; }
  const RowMatX<double>& inverse_mass_matrix() const { return aba_.dqdd_dtau; }

 private:
  void effect_torques(const double* q, const double* qd, int run, double* tau);

  ExtendedTree model_;
  int n_ = 0;
  AbaWorkspace<double, double> aba_ws_;
  AbaDerivatives aba_;
  VecX<double> tau_;
  std::vector<JetD> q_, qd_, parameters_, effect_tau_;
  RowMatX<double> dtau_dq_, dtau_dqd_;
};

}  // namespace diffnea
