#include "diagnose/resonance.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

namespace diffnea {
namespace {

/// Damping ratios, from that of the grid to a gear's, each as much narrower as the last.
constexpr double kRatios[] = {kSwing, 0.1, 0.03};
/// Logarithm of the grid's step in stiffness, a factor of √10: the stiffness lies within one.
constexpr double kGridStep = 1.15;

/// χ² that an effect removes of what is left beside base and other terms, as it is.
double removed(const Search& search, const VecX<double>& left, const TriedEffect& effect) {
  const Beside torque = search.projection().beside(search.evidence().torque_of(effect));
  return 2.0 * search.projection().expanded(torque).col(0).dot(left) - product(torque, torque)(0, 0);
}

}  // namespace

Term narrowed(const Search& search, const Term& term, const std::vector<Term>& terms) {
  const double inertia = search.candidate(term).swings;
  if (!(inertia > 0.0)) return term;  // a gap, whose link flies
  const int stiffness = term.effect.index_of("stiffness"),
            damping = term.effect.index_of("damping");
  const VecX<double> left = search.left_by(terms);
  TriedEffect best = term.effect;
  double most = removed(search, left, best), reach = kGridStep;
  double center = std::log(term.effect.parameters[stiffness]);
  for (const double ratio : kRatios) {
    const double step = 2.0 * ratio, about = center;  // half of the resonance's width
    double most_here = -1e300;
    const int steps = static_cast<int>(std::ceil(reach / step));
    for (int i = -steps; i <= steps; ++i) {
      TriedEffect at = term.effect;
      const double k = about + step * i;
      at.parameters[stiffness] = std::exp(k);
      at.parameters[damping] = 2.0 * ratio * std::sqrt(std::exp(k) * inertia);
      const double gain = removed(search, left, at);
      if (gain > most_here) most_here = gain, center = k;
      if (gain > most) most = gain, best = at;
    }
    reach = step;
  }
  Term out = term;
  out.effect = best;
  search.set_columns(out);
  return out;
}

}  // namespace diffnea
