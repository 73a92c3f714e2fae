/// How far parameters may be from their prior, and where a fit begins.

#include <algorithm>
#include <cmath>

#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/model/physical.hpp>

#include "identify/stacked_factors.hpp"

namespace diffnea {

VecX<double> parameter_scales(const FitLayout& layout, const std::vector<JointFactor>& factors) {
  VecX<double> scale(layout.linear.size());
  for (std::size_t i = 0; i < layout.linear.size(); ++i) scale[i] = layout.linear[i].scale;
  VecX<double> largest = VecX<double>::Zero(layout.linear.size());
  for (const JointFactor& f : factors) {
    if (f.factor.rows() == 0) continue;
    const MatX<double> R = f.factor.R();
    const double torque =
        torque_size(layout, f, layout.prior()) * std::sqrt(static_cast<double>(f.factor.rows()));
    for (std::size_t k = 0; k < f.columns.size(); ++k) {
      const int c = f.columns[k];
      if (!std::isnan(layout.linear[c].scale)) continue;
      const double share = R.col(static_cast<long>(k)).norm() / std::max(torque, 1e-300);
      largest[c] = std::max(largest[c], share);
    }
  }
  for (long c = 0; c < scale.size(); ++c)
    if (std::isnan(scale[c]))
      scale[c] =
          std::max(std::abs(layout.linear[c].prior), largest[c] > 0 ? 1.0 / largest[c] : 1.0);
  return scale;
}

namespace {

/// A body of which some values are held and no body is known: those values, and a ball about its
/// center.
Theta<double> ball_with_held(const FitLayout& layout, int b, const Theta<double>& t, double m,
                             double I) {
  const auto held = [&](int k) { return layout.linear[b + k].fixed; };
  if (held(0)) m = t[0];
  Vec3<double> h{held(1) ? t[1] : 0.0, held(2) ? t[2] : 0.0, held(3) ? t[3] : 0.0};
  Theta<double> out =
      inertia_from_com<double>(m, h * (1.0 / std::max(m, 1e-300)), Sym3<double>{I, 0, 0, I, 0, I})
          .theta();
  for (int k = 0; k < kThetaSize; ++k)
    if (held(k)) out[k] = t[k];
  return out;
}

}  // namespace

VecX<double> consistent_start(const FitLayout& layout, const VecX<double>& scale) {
  VecX<double> x = layout.prior();
  for (const int b : layout.bodies()) {
    Theta<double> t;
    std::copy_n(x.data() + b, kThetaSize, t.begin());
    const double m = scale[b], I = scale[b + 4];
    const Theta<double> ball{m, 0, 0, 0, I, 0, 0, I, 0, I};
    // A thin or flat link lies on the boundary; a thousandth of the ball moves it inside.
    Theta<double> inner;
    const bool consistent = smallest_pseudo_inertia_eigenvalue(t) > -1e-12 * (t[0] + I) && t[0] > 0;
    for (int k = 0; k < kThetaSize; ++k) inner[k] = t[k] + 1e-3 * ball[k];
    if (!consistent) inner = ball_with_held(layout, b, t, m, I);
    const bool inside =
        consistent && smallest_pseudo_inertia_eigenvalue(t) > 1e-6 * (t[0] * I > 0 ? I : 1.0);
    std::ranges::copy(inside ? t : inner, x.data() + b);
  }
  for (std::size_t i = 0; i < layout.linear.size(); ++i)
    if (layout.linear[i].sign != Sign::kFree && !layout.linear[i].fixed)
      x[i] = std::max(x[i], 0.01 * scale[i]);
  return x;
}

}  // namespace diffnea
