#pragma once
/// Forward dynamics of a model with its effects, and what simulation-based fits need of it:
/// derivatives with respect to state and to every linear parameter.

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/tree_constraints.hpp>
#include <diffnea/effects/extended_tree.hpp>

namespace diffnea {

/// Whether the effect's torque reads q̈ or the transmitted torque, so that q̈ is the solution of an
/// equation.
bool reads_acceleration(const BoundEffect& e);

/// 1 + ε of every joint, (n): recorded over true torque (torque_gain), 1 where nothing says
/// otherwise. The recorded torque u is (1 + ε)(M_links q̈ + c) + armature q̈ + effects, hence what
/// reaches the links is u less armature and effects, all of it over 1 + ε.
/// @throws ModelError if it is not above 0: no drive pulls against its own command
VecX<double> torque_gains(const std::vector<BoundEffect>& effects, int num_dofs);

/// q̈ = M⁻¹(u − c(q, q̇) − τ_effects(q, q̇)) with derivatives; where effects read q̈ or the torque
/// τ = M_links q̈ + c that the links transmit, q̈ solves that equation. Evaluates one state at a time;
/// not thread-safe.
class ForwardDynamics {
 public:
  /// Torque gains leave the list of effects, and the tree's armature is over 1 + ε.
  /// @throws ModelError for effects with memory or of a measurement channel (sim/record.hpp
  /// integrates those), and for gains that turn a torque around
  explicit ForwardDynamics(ExtendedTree model);
  /// The same under constraints, which acceleration() knows and linearise() refuses.
  /// @throws ModelError as above; for effects that read q̈ or the transmitted torque, which
  /// constraints change
  ForwardDynamics(ExtendedTree model, TreeConstraints<double> constraints);

  /// Number of joints.
  int num_dofs() const { return n_; }
  /// Tree and effects.
  ExtendedTree& model() { return model_; }
  /// Tree and effects.
  const ExtendedTree& model() const { return model_; }

  /// Time since the run began [s], which warm_up reads, and the step of a simulation that it lies
  /// in, over which commands are taken.
  void set_time(double time, const SimulationStep& step = {}) {
    time_ = time;
    step_ = step;
  }
  /// Time that was set [s].
  double time() const { return time_; }
  /// Step that was set.
  const SimulationStep& step() const { return step_; }
  /// Commands of the run, which outlive it; null: none, so that drives with a loop of their own are
  /// off.
  void set_command(const CommandPath* command) { command_ = command; }
  /// Commands as they were set; null: none.
  const CommandPath* command() const { return command_; }

  /// 1 + ε, (n): ∂q̈/∂u is M⁻¹ over it.
  const VecX<double>& gains() const { return gains_; }

  /// q̈ alone. @param q, qd, u  (n)  @param qdd  (n), written; NaN where an effect that needs q̈ or
  /// the transmitted torque leaves no solution
  void acceleration(const double* q, const double* qd, const double* u, int run, double* qdd);

  /// Also ∂q̈/∂q, ∂q̈/∂q̇ and M⁻¹, effects included; read them from the accessors. Effects E that read
  /// q̈ or τ make S = M + ∂E/∂q̈ + ∂E/∂τ M_links of M.
  /// @throws ModelError for effects that it has no derivatives of: those that need the time or the
  /// place of a link; beside constraints
  void linearise(const double* q, const double* qd, const double* u, int run);
  /// (n) accelerations of the last call [rad/s²].
  const VecX<double>& qdd() const { return aba_.qdd; }
  /// (n, n), of the last call.
  const RowMatX<double>& dqdd_dq() const { return aba_.dqdd_dq; }
  /// (n, n), of the last call.
  const RowMatX<double>& dqdd_dqd() const { return aba_.dqdd_dqd; }
  /// (n, n) M⁻¹ or S⁻¹ of the last call: ∂q̈ over a torque at the links.
  const RowMatX<double>& inverse_mass_matrix() const { return aba_.dqdd_dtau; }

  /// Tells whether an effect reads q̈ or the transmitted torque.
  bool is_implicit() const { return !implicit_.empty(); }
  /// (n) torque that the links transmit at the q̈ of the last call, where is_implicit().
  const VecX<double>& transmitted() const { return transmitted_; }
  /// (n, n) 1 + ∂E/∂τ of the last linearise(), where is_implicit(): what a torque of the links takes.
  const RowMatX<double>& link_share() const { return link_share_; }

 private:
  void effect_torques(const double* q, const double* qd, int run, double* tau);
  void solve_implicit(const double* q, const double* qd, const VecX<double>& tau, int run,
                      double* qdd);
  void torque_by_jets(const BoundEffect& e, int run);
  void add_implicit(std::size_t effect, const double* qdd, int run);

  ExtendedTree model_;
  TreeConstraints<double> constraints_;
  ConstrainedTreeWorkspace<double, double> constrained_ws_;
  /// Joints that an effect of the model depends on.
  struct Reads {
    std::vector<int> joints;
    bool coupled = false;  ///< one joint's torque depends on another
    bool implicit = false;  ///< reads_acceleration()
  };
  std::vector<Reads> reads_;
  std::vector<std::size_t> implicit_;  ///< effects that read q̈ or the transmitted torque
  int n_ = 0;
  VecX<double> gains_;
  double time_ = 0.0;
  SimulationStep step_;
  const CommandPath* command_ = nullptr;
  MassMatrixWorkspace<double, double> mass_ws_;
  RneaWorkspace<double, double> rnea_ws_;
  AbaWorkspace<double, double> aba_ws_;
  AbaDerivatives aba_;
  VecX<double> tau_;
  std::vector<JetD> q_, qd_, qdd_, links_, parameters_, effect_tau_;
  RowMatX<double> dtau_dq_, dtau_dqd_;
  VecX<double> transmitted_, implicit_tau_, still_, solution_, free_, bias_, off_;
  MatX<double> mass_, links_mass_, by_qdd_, by_links_, slope_;
  RowMatX<double> link_share_;
};

}  // namespace diffnea
