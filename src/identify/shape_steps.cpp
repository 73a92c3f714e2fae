#include "identify/shape_steps.hpp"

#include <algorithm>
#include <cmath>

namespace diffnea {

FitLayout with_shape_steps(const FitLayout& layout) {
  FitLayout out = layout;
  for (const FitParameter& s : layout.shape)
    if (!s.fixed) {
      FitParameter step = s;
      step.name += " (step)";
      step.sign = Sign::kFree;
      step.prior = 0.0;
      // Ten times that by prior_width: an e-fold; 1 rad or m of a rest, 1 m/s² of a tilt; of a
      // transform 0.1 rad, 0.1 m.
      step.scale = s.kinematic >= 0 ? 0.01 : 0.1;
      out.linear.push_back(step);
    }
  return out;
}

void use_amplitudes(const FitLayout& layout, const VecX<double>& at, const VecX<double>& x,
                    VecX<double>& step) {
  long k = 0;
  for (const FitParameter& shape : layout.shape) {
    if (shape.fixed) continue;
    const long here = k++;
    if (shape.logarithmic || shape.kinematic >= 0) continue;
    std::vector<long> amplitudes;
    for (std::size_t c = 0; c < layout.linear.size(); ++c)
      if (layout.linear[c].effect == shape.effect) amplitudes.push_back(static_cast<long>(c));
    if (amplitudes.size() == 1 && x[amplitudes[0]] != 0.0)
      step[here] *= at[amplitudes[0]] / x[amplitudes[0]];
  }
}

double stepped(const FitParameter& shape, double value, double step) {
  if (shape.logarithmic) return value * std::exp(std::clamp(step, -0.7, 0.7));  // a factor of two
  const double longest = shape.kinematic >= 0 ? 0.1 : 1.0;  // [rad], [m], [m/s²]
  const double moved = value + std::clamp(step, -longest, longest);
  return shape.sign == Sign::kFree ? moved : std::max(moved, 0.0);
}

}  // namespace diffnea
