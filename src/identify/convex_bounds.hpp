#pragma once
/// Shared by the two solvers of a ConvexFitProblem. Internal to identify/.

#include <diffnea/identify/convex_fit.hpp>

namespace diffnea {

/// @throws ShapeError, ModelError as solve_convex_fit
void check_convex_problem(const ConvexFitProblem& problem);

/// Objective, price of consistency, and what presses against its bound at result.x.
void describe_optimum(const ConvexFitProblem& problem, ConvexFitResult& result);

}  // namespace diffnea
