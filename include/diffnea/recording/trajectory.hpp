#pragma once
/// Desired motion of joints over time: what an excitation is, and what a controller follows.

#include <string>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// N rows, n joints.
struct Trajectory {
  std::string source;                    ///< file, for messages
  std::vector<std::string> joint_names;  ///< (n) in the order of the columns
  VecX<double> time;                     ///< (N) [s], strictly increasing
  RowMatX<double> q;                     ///< (N, n) desired position [rad] or [m]
  RowMatX<double> qd;                    ///< (N, n) [rad/s] or [m/s]
  RowMatX<double> qdd;                   ///< (N, n) [rad/s²] or [m/s²]

  /// Number of rows.
  long rows() const { return time.size(); }
  /// Number of joints.
  int num_joints() const { return static_cast<int>(joint_names.size()); }
};

}  // namespace diffnea
