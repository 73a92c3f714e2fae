#pragma once
/// Numbers with a name. Internal.

#include <limits>
#include <numbers>

namespace diffnea {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kPi = std::numbers::pi;

}  // namespace diffnea
