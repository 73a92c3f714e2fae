#pragma once
/// One window of a recording, simulated: its output error, and the sensitivities of that to the
/// initial state and the free parameters. Internal to identify/.

#include <vector>

#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/identify/trajectory_fit.hpp>

namespace diffnea {

/// The model at given parameters, with sensitivities to (initial state | free parameters).
class WindowSimulator {
 public:
  /// @param free  linear columns of the layout that are estimated
  /// @param x     (linear columns)
  /// @param runs  of the recordings, sorted
  /// @param options  outlives this
  WindowSimulator(const Model& model, const FitLayout& layout, const VecX<double>& x,
                  const std::vector<int>& free, const std::vector<int>& runs,
                  const TrajectoryOptions& options);

  ForwardDynamics& dynamics() { return dynamics_; }

  /// Residual rows q̂ − q over sigma: [J_state | J_parameters | residual]; false if it blew up.
  bool rows(const ShootingWindow& w, const VecX<double>& sigma, RowMatX<double>& out);

  /// ½ Σ (residual/σ)² of one window; +∞ if it blew up.
  double cost(const ShootingWindow& w, const VecX<double>& state, const VecX<double>& sigma);

 private:
  /// d/dt [z | Z]: Z̈_q = ∂q̈/∂q Z_q + ∂q̈/∂q̇ Z_q̇ − M⁻¹ C in the parameters' columns.
  void sensitivity_slope(int run, const VecX<double>& u, const MatX<double>& A, MatX<double>& dA);

  /// C = ∂τ/∂x at q̈, at the links (armature and friction over 1 + ε): ∂q̈/∂x = −M⁻¹ C.
  void columns(int run, const VecX<double>& z, const VecX<double>& qdd);

  const TrajectoryOptions& options_;
  ForwardDynamics dynamics_;
  Tree<double> geometry_;
  int n_, f_;
  std::vector<BoundEffect> effects_;
  std::vector<std::vector<int>> effect_columns_;
  std::vector<int> slot_;  // per linear column: its place among the free ones, −1 if fixed
  RegressorWorkspace<double, double> ws_;
  MatX<double> C_;
  std::vector<double> scratch_;
};

}  // namespace diffnea
