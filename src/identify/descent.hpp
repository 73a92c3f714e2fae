#pragma once
/// Levenberg–Marquardt (Nocedal, Wright 2006, sec. 10.3): the descent of every fit by nonlinear
/// least squares. What a step costs and where it leads is the problem's: windows eliminate their
/// first states, parameters keep their signs, noise is estimated along the way. Internal to
/// identify/.

#include <algorithm>

namespace diffnea {

/// How a descent ended.
enum class DescentEnd {
  kConverged,  ///< the last step gained less than the tolerance, and weights have settled
  kNoStep,     ///< no step makes it better, however short
  kLimit,      ///< the largest number of steps is reached
  kStopped     ///< the caller said so
};

struct DescentOptions {
  int max_steps = 100;      ///< refused ones included
  double tolerance = 1e-8;  ///< share of the cost that a last step gains
  double damping = 1e-3;    ///< relative to the curvature, of the first step
};

/// Descends from the problem's present point to a minimum near it. A problem has
///
///     double cost();                   // at the present point, weights as they are
///     void linearise();                // about the present point
///     double attempt(double damping);  // goes a step, damped relative to the curvature; its cost
///     void accept();                   // stays there
///     void refuse();                   // goes back
///     bool stopped();                  // whether the caller wants no more; asked after each step
///     bool settled();                  // whether the weights of the present point are those in
///     use void reweigh();                  // takes those of the present point
///
/// @param steps  counted up, refused ones included
template <class Problem>
DescentEnd descend(Problem& problem, const DescentOptions& options, int& steps) {
  // Damping within which a double tells a step from none.
  constexpr double kLeastDamping = 1e-9, kMostDamping = 1e8;
  double now = problem.cost(), damping = options.damping;
  bool linear = false;
  for (int k = 0; k < options.max_steps; ++k, ++steps) {
    if (!linear) problem.linearise();
    linear = true;
    const double then = problem.attempt(damping);
    if (!(then < now)) {
      problem.refuse();
      damping *= 10.0;
      if (damping > kMostDamping) return DescentEnd::kNoStep;
      if (problem.stopped()) return DescentEnd::kStopped;
      continue;
    }
    const bool small = now - then < options.tolerance * now;
    problem.accept();
    damping = std::max(kLeastDamping, 0.1 * damping);
    linear = false;
    if (problem.stopped()) return DescentEnd::kStopped;
    if (problem.settled() && small) return DescentEnd::kConverged;
    problem.reweigh();
    now = problem.cost();
  }
  return DescentEnd::kLimit;
}

}  // namespace diffnea
