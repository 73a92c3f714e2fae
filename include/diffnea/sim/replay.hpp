#pragma once
/// A stretch of a recording simulated again by a model with all its effects: from a first state on,
/// driven by the measured torque.

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// Positions, (end − begin, n) [rad] or [m], as the encoders of the model would log them; NaN from
/// where the simulation blew up, and where a late clock leaves no value. Effects with memory start
/// as the half second before has left them.
/// @param x       motion as logged. At least one row before `begin` and one behind `end`
/// @param torque  (N, n) that acts from row k to k+1
/// @param first   (2n) q, q̇ at row `begin`, on the torque's clock; null: those of x
/// @param run     the recording that effects of single recordings see
/// @throws ModelError if effects cannot act together; ShapeError if arrays differ in shape or lack
/// the
///         rows around the window
RowMatX<double> replay(const ExtendedTree& model, const JointSeries& x,
                       const RowMatX<double>& torque, long begin, long end,
                       const VecX<double>* first = nullptr, int run = 0);

}  // namespace diffnea
