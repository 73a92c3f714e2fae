#include "identify/motionless.hpp"

#include <algorithm>

namespace diffnea {

std::vector<int> motionless_joints(const Pass& pass, const PreprocessPlan& plan) {
  std::vector<int> out;
  for (long j = 0; j < pass.lowest.size(); ++j) {
    const double noise = j < static_cast<long>(plan.q_noise.size()) ? plan.q_noise[j] : 0.0;
    const double range = pass.highest[j] - pass.lowest[j];
    if (range <= std::max(10.0 * noise, 1e-6)) out.push_back(static_cast<int>(j));
  }
  return out;
}

void hold_motionless(const std::vector<int>& joints, FitLayout& layout) {
  for (auto* list : {&layout.linear, &layout.shape})
    for (FitParameter& p : *list) {
      if (p.effect < 0) continue;
      const BoundEffect& e = layout.effects[p.effect];
      const bool constant = e.info().reads == Reads::kNothing;
      const bool still = std::ranges::any_of(
          joints, [&](int j) { return std::ranges::find(e.joints, j) != e.joints.end(); });
      if (still && !constant && e.info().port == Port::kJointTorque) p.fixed = true;
    }
}

}  // namespace diffnea
