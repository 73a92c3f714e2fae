#pragma once
/// A movement as lines in the upright plane in which it happens: what pictures of it are drawn
/// from.

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>
#include <diffnea/policy/rollouts.hpp>

namespace diffnea {

/// An upright plane: across is a horizontal unit vector of W, up is z.
struct SideView {
  double x = 1.0;  ///< of across, in W
  double y = 0.0;  ///< of across, in W
};
/// The upright plane in which the balls of traces move most. One that is within 10° of two axes of
/// W is that of these axes.
SideView side_view(const std::vector<RolloutTrace>& traces);

/// Points of arm, cup, string and ball, one row an instant of the trace.
struct StickFigure {
  VecX<double> time;               ///< (T) [s]
  std::vector<std::string> names;  ///< arm_0 … along the arm from its foot to the cup's frame, then
                                   ///< knot, rim_left, floor_left, floor_right, rim_right, ball
  RowMatX<double> across;          ///< (T × names) along the view's across, from W's origin [m]
  RowMatX<double> up;              ///< (T × names) along W's z [m]
  /// Points of the arm; the others are of cup and ball.
  int arm_points() const { return static_cast<int>(names.size()) - 6; }
};

/// The arm is drawn where the model has it at the trace's joint positions; cup and ball are the
/// trace's own.
/// @param trace  with q_<joint> of the model's joints, ball, cup and axis; no rows: no figure
/// @throws Error if it lacks one; ModelError if the model has no cup
StickFigure stick_figure(const Model& model, const RolloutTrace& trace, const SideView& view);

/// Columns `name`_x, _y, _z of a trace, (T × 3). @throws Error if it has none
RowMatX<double> points_of(const RolloutTrace& trace, const std::string& name);
/// Column `name`, (T). @throws Error that names it
VecX<double> channel_of(const RolloutTrace& trace, const std::string& name);

}  // namespace diffnea
