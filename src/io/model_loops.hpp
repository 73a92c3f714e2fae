#pragma once
/// Report of `info` on a model's constraints: how far its reference posture is from meeting
/// them, and the motions that they leave.

#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// A constraint at the reference posture.
struct ConstraintGap {
  double apart = 0.0;   ///< distance of its points; of a wheel of its lowest point to z = 0 [m]
  double turned = 0.0;  ///< angle between its frames (weld) or z axes (hinge) [rad]
};

/// All of them. The reference posture is `home` where the model has one, else each joint at 0 or
/// the limit next to it, and the base where its file has it.
struct LoopReport {
  std::vector<ConstraintGap> gaps;  ///< one per constraint
  int coordinates = 0;              ///< number of them in the tree, the base's six among them
  int left = 0;                     ///< number that constraints leave, where they are closed
  bool closes = false;              ///< a posture near the reference closes all of them
  double remains = 0.0;             ///< largest residual that it leaves, in the constraints' units
  double farthest = 0.0;  ///< largest change of a coordinate to where they are closed [rad, m]
};

/// @throws as make_tree
LoopReport report_loops(const Model& model);

}  // namespace diffnea::io
