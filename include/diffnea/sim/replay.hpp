#pragma once
/// A stretch of a recording simulated again by a model with all its effects: from the measured
/// state on, driven by the measured torque, with the recording's controller in the loop where its
/// gains are known.

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// A controller τ = feed-forward(t) + kp (q_cmd − q) + kd (q̇_cmd − q̇). What it commanded for the
/// measured motion is recorded; for a simulated one it commands kp (q_measured − q) + kd
/// (q̇_measured − q̇) more, whatever its feed-forward is.
struct Feedback {
  VecX<double> kp;     ///< (n) [N·m/rad] or [N/m]
  VecX<double> kd;     ///< (n) [N·m·s/rad] or [N·s/m]
  VecX<double> limit;  ///< (n) of the torque [N·m] or [N]; infinite if there is none
};

/// Positions, (end − begin, n) [rad] or [m], as the encoders of the model would log them; NaN from
/// where the simulation blew up. Effects with memory start as the half second before has left them.
/// @param x         motion as logged; `logged` is the torque about each row. At least one row
///                  before `begin` and one behind `end`
/// @param feedback  null: the measured torque alone
/// @param run       the recording that effects of single recordings see
/// @throws ModelError if effects cannot act together; ShapeError if arrays differ in shape or lack
/// the
///         rows around the window
RowMatX<double> replay(const ExtendedTree& model, const JointSeries& x, long begin, long end,
                       const Feedback* feedback, int run = 0);

}  // namespace diffnea
