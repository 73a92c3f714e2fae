#pragma once
/// Planar linkages as models: a chain of bars in the plane x, z whose last one is pinned to the
/// ground. Three bars make a four-bar linkage, four a five-bar.

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea::test {

/// Joints j1 … turn about y; `home` is near a closed posture.
/// @param bars  3 or 4  @param driven  joints with a motor, from 0
inline Model linkage(int bars, const std::vector<int>& driven) {
  const std::vector<double> lengths =
      bars == 3 ? std::vector{0.3, 0.8, 0.6} : std::vector{0.35, 0.6, 0.7, 0.4};
  Model m;
  m.name = "linkage";
  m.home = bars == 3 ? std::vector{-1.1, 0.6, 1.4} : std::vector{-1.6, 1.2, 0.9, 0.9};
  for (int i = 0; i < bars; ++i) {
    ModelLink link;
    link.name = "bar" + std::to_string(i + 1);
    link.joint = "j" + std::to_string(i + 1);
    link.parent = i - 1;
    link.type = ModelJoint::kRevolute;
    link.axis = {0, 1, 0};
    const double before = i > 0 ? lengths[static_cast<std::size_t>(i - 1)] : 0.0,
                 length = lengths[static_cast<std::size_t>(i)], mass = 1.0 + 0.3 * i;
    link.X_PJ = Pose<double>::translation({before, 0, 0});
    const double turn = mass * length * length / 10.0;
    link.inertia = inertia_from_com<double>(mass, {0.45 * length, 0, 0.02},
                                            {turn / 2, 0, 0, turn, 0, turn / 2});
    link.passive = true;
    for (const int j : driven) link.passive = link.passive && j != i;
    m.links.push_back(link);
  }
  ConstraintSpec pin;
  pin.name = "pin";
  pin.first.X_LF = Pose<double>::translation({bars == 3 ? 0.9 : 0.5, 0, 0});
  pin.second.link = bars - 1;
  pin.second.X_LF = Pose<double>::translation({lengths.back(), 0, 0});
  m.constraints.push_back(pin);
  return m;
}

/// Drives that hold the linkage: the first, or the first two.
inline Model linkage(int bars) {
  return linkage(bars, bars == 3 ? std::vector{0} : std::vector{0, 1});
}

}  // namespace diffnea::test
