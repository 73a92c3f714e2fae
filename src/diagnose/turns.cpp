#include "diagnose/turns.hpp"

#include <cmath>

namespace diffnea {
namespace {

constexpr double kBend = 0.2;      ///< of ln v₀, to either side

}  // namespace

bool is_smoothing(const FitParameter& shape) { return shape.name.ends_with(".smoothing"); }

std::set<int> dry_joints(const FitLayout& layout) {
  std::set<int> out;
  for (const FitParameter& s : layout.shape)
    if (is_smoothing(s))
      for (const int j : layout.effects[s.effect].joints) out.insert(j);
  return out;
}

BoundEffect friction_of(const FitLayout& layout, const FitParameter& smoothing) {
  BoundEffect out = layout.effects[smoothing.effect];
  for (const auto* list : {&layout.linear, &layout.shape})
    for (const FitParameter& p : *list)
      if (p.effect == smoothing.effect) out.parameters[p.index] = p.prior;
  return out;
}

std::array<RowMatX<double>, kTurnColumns> turn_columns(const BoundEffect& friction, int smoothing,
                                                       const ExtendedTree& base,
                                                       const JointSeries& x) {
  const auto moved = [&](double seconds) {
    JointSeries at = x;
    for (const int j : friction.joints) at.qd.col(j) = shifted(x.qd.col(j), x.dt, seconds);
    return series_torque(friction, base, at, friction.parameters.data());
  };
  const auto sharper = [&](double factor) {
    std::vector<double> p = friction.parameters;
    p[smoothing] *= factor;
    return series_columns(friction, base, x, p.data(), {smoothing}).front();
  };
  return {(moved(kEarlier) - moved(-kEarlier)) / 2.0,
          (sharper(std::exp(kBend)) - sharper(std::exp(-kBend))) / (4.0 * kBend)};
}

}  // namespace diffnea
