#pragma once
/// Whether all torques differ from what the described links need by one factor. Internal to
/// identify/.

#include <optional>
#include <string>
#include <vector>

#include <diffnea/identify/layout.hpp>
#include <diffnea/identify/linear_fit.hpp>

namespace diffnea {

/// Recorded torque over that of the links as the model described them, beside everything else that
/// is fitted (friction, offsets, rotors).
struct TorqueScale {
  double factor = 1.0;                           ///< median of the joints
  std::vector<std::pair<int, double>> of_joint;  ///< that agree: joint, factor
};

/// A factor that two joints or more, and four fifths of those that determine one, agree on (to 15
/// %; from a factor of 3 on, to a third of its logarithm), and that is none of chance:
/// beyond 1.25 either way, with an error below half of that without it at each of these joints.
/// Masses that are wrong link by link agree on none.
/// @param factors  of the inverse loss, in torques, one a joint
std::optional<TorqueScale> common_torque_scale(const FitLayout& layout,
                                               const std::vector<JointFactor>& factors);

}  // namespace diffnea
