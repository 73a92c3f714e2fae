#pragma once
/// Where a link of a model sits in its tree. Internal.

#include <utility>

#include <diffnea/model/model.hpp>

namespace diffnea::detail {

/// The tree's link that a link of the model is part of, and its pose in it; −1: the world.
inline std::pair<int, Pose<double>> place_in_tree(const TreeMap& map, int link) {
  if (link < 0) return {-1, Pose<double>::identity()};
  return {map.dof[static_cast<std::size_t>(link)], map.X_LF[static_cast<std::size_t>(link)]};
}

}  // namespace diffnea::detail
