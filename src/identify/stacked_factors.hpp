#pragma once
/// The factors of all joints as one least-squares problem. Internal.

#include <vector>

#include <diffnea/identify/linear_fit.hpp>

namespace diffnea {

/// Which parameters are free, as columns of the layout.
std::vector<int> free_columns(const FitLayout& layout);

/// Root mean square of the torque that the links alone take at parameters x [N·m].
double link_torque(const FitLayout& layout, const JointFactor& f, const VecX<double>& x);

/// Root mean square that a joint's errors are small or large beside [N·m]: of its torque; of a
/// passive joint, whose torque is zero but for what filters leave, of what its links take at x.
double torque_size(const FitLayout& layout, const JointFactor& f, const VecX<double>& x);

/// ‖R x − d‖² over all columns, in units of the joints' noise.
struct StackedFactors {
  MatX<double> R;
  VecX<double> d;
};
/// @param sigma  (n) noise of each joint
/// @param at     about which rows of passive joints are linear; null: as they are
StackedFactors stacked(const std::vector<JointFactor>& factors, const VecX<double>& sigma,
                       long columns, const VecX<double>* at = nullptr);

}  // namespace diffnea
