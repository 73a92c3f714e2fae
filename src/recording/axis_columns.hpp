#pragma once
/// Columns of series that have axes in place of joints: a ball's, and those of a base that floats.
/// Internal.

#include <string>
#include <string_view>

#include <diffnea/recording/recording.hpp>

#include "recording/column_units.hpp"

namespace diffnea::detail {

/// Axes of one unit, all of which a file has, or none: base_qx, base_qy, base_qz, base_qw.
struct AxisColumns {
  std::string_view where;   ///< owner, as faults name it
  std::string_view prefix;  ///< beginning of the column names
  std::string_view axes;    ///< a letter a column
  Channel channel;
  std::string_view unit;  ///< SI
  RowMatX<double> Recording::* series;
  long first;  ///< column of the series that the first axis is
  long width;  ///< columns of the series

  /// Name of the column of one axis.
  std::string column(std::size_t axis) const { return std::string(prefix) + axes[axis]; }
  /// Names of all, with commas.
  std::string columns() const {
    std::string out;
    for (std::size_t axis = 0; axis < axes.size(); ++axis)
      out += (axis == 0 ? "" : ", ") + column(axis);
    return out;
  }
};

inline constexpr AxisColumns kAxisColumns[] = {
    {"ball", "ball_", "xyz", Channel::kBall, "m", &Recording::ball, 0, 3},
    {"ball", "spin_", "xyz", Channel::kSpin, "rad/s", &Recording::spin, 0, 3},
    {"base", "base_", "xyz", Channel::kBasePosition, "m", &Recording::base, 0, 7},
    {"base", "base_q", "xyzw", Channel::kBaseQuaternion, "1", &Recording::base, 3, 7},
    {"base", "base_w", "xyz", Channel::kBaseTurning, "rad/s", &Recording::base_twist, 0, 6},
    {"base", "base_v", "xyz", Channel::kBaseVelocity, "m/s", &Recording::base_twist, 3, 6},
    {"base", "base_t", "xyz", Channel::kBaseTorque, "N*m", &Recording::base_wrench, 0, 6},
    {"base", "base_f", "xyz", Channel::kBaseForce, "N", &Recording::base_wrench, 3, 6},
};

/// @return null for a channel of another kind
constexpr const AxisColumns* axis_columns(Channel channel) {
  for (const AxisColumns& of : kAxisColumns)
    if (of.channel == channel) return &of;
  return nullptr;
}

}  // namespace diffnea::detail
