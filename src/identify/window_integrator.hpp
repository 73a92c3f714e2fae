#pragma once
/// One window, integrated; shared by plain simulation and by sensitivities. Internal to identify/.

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/integrators.hpp>
#include <diffnea/identify/shooting_window.hpp>

namespace diffnea {

/// A state beyond this is a blow-up, whatever the robot [rad, rad/s or m, m/s].
inline constexpr double kBlowUp = 1e6;
inline constexpr int kMaxSubsteps = 50;

/// Bound on the eigenvalues of ∂q̈/∂q̇ at rest, where dry friction is steepest [1/s].
inline double fastest_rate(ForwardDynamics& dynamics, const ShootingWindow& w) {
  const int n = dynamics.num_dofs();
  const VecX<double> q = w.measured_state.head(n), rest = VecX<double>::Zero(n), u = w.u.row(0);
  dynamics.linearise(q.data(), rest.data(), u.data(), w.run);
  return dynamics.dqdd_dqd().cwiseAbs().rowwise().sum().maxCoeff();
}

/// Integrates the columns of A = [state | sensitivities] (2n, …) along the window's torque.
/// @param slope   slope(u, A, dA)
/// @param at_row  called with (k, A) at every row k of the window
/// @return false if the state blew up before the last row
template <class Slope, class AtRow>
bool integrate(const ShootingWindow& w, double rate, double max_step, MatX<double>& A,
               const Slope& slope, const AtRow& at_row) {
  RungeKutta4<MatX<double>> rk;
  const long m = static_cast<long>(w.time.size());
  VecX<double> u;
  for (long k = 0; k < m; ++k) {
    at_row(k, A);
    if (k + 1 == m) break;
    const double h = w.time[k + 1] - w.time[k];
    const int steps = std::clamp(static_cast<int>(std::ceil(h * rate / max_step)), 1, kMaxSubsteps);
    for (int s = 0; s < steps; ++s) {
      const auto f = [&](double share, const MatX<double>& at, MatX<double>& d) {
        const double a = (s + share) / steps;
        u = ((1 - a) * w.u.row(k) + a * w.u_end.row(k)).transpose();
        slope(u, at, d);
      };
      rk.step(f, h / steps, A);
      if (!(A.col(0).cwiseAbs().maxCoeff() < kBlowUp)) return false;
    }
  }
  return true;
}

/// q̈ alone: the slope of a state without sensitivities.
inline auto state_slope(ForwardDynamics& dynamics, int run) {
  return [&dynamics, run](const VecX<double>& u, const MatX<double>& z, MatX<double>& dz) {
    const int n = dynamics.num_dofs();
    dz.resize(2 * n, 1);
    dz.topRows(n) = z.bottomRows(n);
    dynamics.acceleration(z.data(), z.data() + n, u.data(), run, dz.data() + n);
  };
}

}  // namespace diffnea
