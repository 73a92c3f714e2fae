#pragma once
/// The problem of convex_fit.hpp in the paper's virtual parameters (appendix "Virtual Physical
/// Parameters"; model/physical.hpp): every point is a body that can exist, so that the descent is
/// free, and not convex. Non-negative parameters are squares. The optimum is that of
/// solve_convex_fit where the descent finds it; where it lies at the boundary, a flat or massless
/// part, the descent creeps. For comparison with the paper.

#include <diffnea/identify/convex_fit.hpp>

namespace diffnea {

/// Descends from the problem's start by Levenberg–Marquardt.
/// @return `converged` where no step gains more than rounding; `iterations` are its steps
/// @throws ShapeError if sizes do not match
/// @throws ModelError if `start` is not strictly consistent, some but not all parameters of a body
///         are fixed, or the problem has an entropic prior: neither is one of virtual parameters
ConvexFitResult solve_virtual_fit(const ConvexFitProblem& problem);

}  // namespace diffnea
