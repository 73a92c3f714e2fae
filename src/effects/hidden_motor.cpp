#include <algorithm>
#include <array>

#include <diffnea/effects/hidden_motor.hpp>

namespace diffnea {

double motor_share(const EffectInfo& effect, double friction_share) {
  static const std::array<std::string, 4> kOfDrives{"cogging", "session_offset", "torque_gain",
                                                    "torque_offset"};
  if (std::ranges::find(kOfDrives, effect.name) != kOfDrives.end()) return 1.0;
  return effect.motor_side ? friction_share : 0.0;
}

}  // namespace diffnea
