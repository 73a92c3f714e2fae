#pragma once
/// A candidate that the catalogue does not have: columns of torque that the caller computes from
/// the motion. It is tried, refused, named and listed as a rival like any effect; model files
/// cannot hold it.
///
///     OwnCandidate twist{"twist", "elbow", {{.name = "stiffness", .unit = "N*m/rad^2"}}, {}};
///     twist.columns = [](const JointSeries& x) -> RowMatX<double> {
///       return x.q.col(0).cwiseProduct(x.q.col(1));
///     };
///     options.candidates = {twist};

#include <functional>
#include <string>
#include <vector>

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// An effect of the caller's own, tried beside the catalogue's: torque columns over a motion.
struct OwnCandidate {
  std::string name;   ///< as results name it; none of the catalogue's
  std::string where;  ///< the joint whose torque it adds to
  /// One for each column: name, unit and sign; the torque is linear in all of them.
  std::vector<ParameterInfo> parameters;
  /// (N, parameters) torque [N·m] or [N] at that joint for one unit of each parameter. Called once
  /// for every uninterrupted stretch of the recordings, with the filtered motion of all joints
  /// (through every other sample, where the log is fast enough), at the recording's rate; and along the motions that are tried as a next experiment.
  std::function<RowMatX<double>(const JointSeries&)> columns;
};

}  // namespace diffnea
