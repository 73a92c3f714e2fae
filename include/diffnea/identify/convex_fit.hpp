#pragma once
/// The physically consistent least-squares fit of parameters that torques are linear in. It is
/// convex:
///
///     minimise ½‖R x − d‖² + ½ (x − x₀)ᵀ Λ (x − x₀) + γ Σ_b [tr(Π₀,b⁻¹ Π_b) − log det Π_b]
///     subject to Π_b(x) ⪰ 0 for every body b, x_k ≥ 0 for every k that must not be negative,
///
/// Π_b the 4×4 pseudo-inertia, linear in a body's ten parameters (Wensing, Kim, Slotine 2018, eq.
/// 12). Solved by a primal barrier method (Newton on the log-determinant barrier), whose optimum is
/// global and whose cost does not depend on the number of samples. Log-Cholesky coordinates turn
/// the same problem into an unconstrained one that is not convex, and let a boundary optimum run to
/// infinity; they serve the losses that are nonlinear in x anyway.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Least squares over bodies that can exist and parameters of known sign.
struct ConvexFitProblem {
  MatX<double> R;                  ///< (m, p), rows in units of their noise
  VecX<double> d;                  ///< (m)
  VecX<double> start;              ///< (p) x₀: strictly consistent; the prior's mean
  MatX<double> prior_information;  ///< (p, p) Λ; empty: none
  std::vector<int> bodies;         ///< first of ten consecutive parameters of each body
  std::vector<int> nonnegative;    ///< parameters that must not be negative
  std::vector<int> fixed;          ///< parameters held at start
  double entropic_prior = 0.0;     ///< γ: pull of each body to its start's shape [units of χ²/2]
};

/// When the barrier method stops.
struct ConvexFitOptions {
  /// The barrier's weight at the end, in units of χ²/2: the objective is within (4·bodies + bounds)
  /// times this of the optimum, far below the one unit in which a parameter moves by its own σ.
  double final_barrier = 1e-6;
  int max_iterations = 300;  ///< Newton steps, over all weights of the barrier
};

/// The optimum, and what presses against the bounds there.
struct ConvexFitResult {
  VecX<double> x;                       ///< (p) the optimum, strictly inside the bounds
  double objective = 0.0;               ///< ½‖Rx − d‖²
  int iterations = 0;                   ///< Newton steps
  bool converged = false;               ///< the last weight of the barrier was solved for
  std::vector<int> active_bodies;       ///< indices into problem.bodies: Π at its boundary
  std::vector<int> active_nonnegative;  ///< parameters at zero
  /// Price of consistency: ½‖Rx − d‖² minus that of unconstrained least squares [χ²/2].
  double consistency_cost = 0.0;
};

/// @throws ShapeError if sizes do not match
/// @throws ModelError if `start` is not strictly consistent
ConvexFitResult solve_convex_fit(const ConvexFitProblem& problem,
                                 const ConvexFitOptions& options = {});

}  // namespace diffnea
