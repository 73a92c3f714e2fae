#include "motion/window_simulator.hpp"

#include <algorithm>

#include "motion/first_states.hpp"

namespace diffnea {

void fit_state(WindowSimulator& simulator, const MotionStretch& stretch, MotionWindow& window,
               const VecX<double>& sigma, const StateFitOptions& options) {
  double now = simulator.cost(stretch, window, sigma);
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    TriangularFactor rows(simulator.states());
    const bool finite = simulator.linearise(stretch, window, sigma, rows);
    const ReducedWindow reduced = eliminate(rows, simulator.states(), finite);
    if (!reduced.finite) return;
    const VecX<double> from = window.state, full = reduced.state_step(VecX<double>(0));
    double best = now;
    VecX<double> best_state = from;
    for (const double share : {1.0, 0.5, 0.2, 0.05, 0.01}) {
      window.state = from + share * full;
      const double c = simulator.cost(stretch, window, sigma);
      if (!(c < best)) continue;
      best = c;
      best_state = window.state;
      break;
    }
    window.state = best_state;
    const double gained = now - best, promised = 0.5 * reduced.top.col(0).squaredNorm();
    if (std::min(now - promised, best) > options.most) return;
    now = best;
    if (now < options.enough) return;
    if (gained > options.tolerance * now) continue;
    constexpr double kMuch = 0.1;  // share of the cost that inexact rows promise and do not keep
    if (!(promised > kMuch * now) || now - promised > options.hopeless || !simulator.sharpen())
      return;
  }
}

}  // namespace diffnea
