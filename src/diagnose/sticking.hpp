#pragma once
/// Where a joint sticks. Internal to diagnose/.
///
/// Friction then gives whatever holds the joint, between −F and F: nothing of the motion tells it,
/// and F tanh(q̇/v₀) of a filtered velocity less than anything. What that leaves at every reversal
/// passes for a spring, a delay or a ripple, on held-out data as well.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// What a position has to do, and for how long, to count as standing still.
struct Standstill {
  double band = 0.0;  ///< it stays within [rad] or [m]
  long rows = 1;      ///< so many, at least
};

/// A standstill that noise does not hide, longer than a reversal at the joint's usual acceleration
/// and than the filter can tell from one.
/// @param q_noise  standard deviation of the logged position [rad] or [m]
/// @param qd, qdd  RMS of velocity and acceleration
/// @param dt       of the rows [s]
Standstill standstill(double q_noise, double qd, double qdd, double filter_hz, double dt);

/// Rows of a logged position that belong to a standstill.
std::vector<bool> stands_still(const Eigen::Ref<const VecX<double>>& q, const Standstill& still);

}  // namespace diffnea
