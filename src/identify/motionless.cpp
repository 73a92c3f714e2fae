#include "identify/motionless.hpp"

#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

namespace diffnea {

std::vector<int> motionless_joints(const VecX<double>& lowest, const VecX<double>& highest,
                                   const std::vector<double>& noise) {
  std::vector<int> out;
  for (long j = 0; j < lowest.size(); ++j) {
    const double known = j < static_cast<long>(noise.size()) ? noise[j] : 0.0;
    if (highest[j] - lowest[j] <= std::max(10.0 * known, 1e-6)) out.push_back(static_cast<int>(j));
  }
  return out;
}

void hold_motionless(const std::vector<int>& joints, const std::vector<std::string>& names,
                     const std::string& source, FitLayout& layout,
                     std::vector<std::string>& notes) {
  if (!joints.empty() && joints.size() == names.size())
    throw DataError(source + ": no joint moves (" + detail::join(names) +
                    "); record a motion, e.g. one of `diffnea excite`");
  for (const int j : joints)
    notes.push_back(names[j] +
                    " never moves: its friction, armature and springs are held at the model's "
                    "values");
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
