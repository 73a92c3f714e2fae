#pragma once
/// Rows in which something holds a joint that its command leads on: an end stop, an object between
/// its fingers, a hand. Internal.

#include <string>
#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea::detail {

/// Consecutive rows in which a joint is held.
struct HeldRows {
  std::size_t recording = 0;
  long first = 0, rows = 0;
  double at = 0.0;      ///< position where it rests [rad] or [m]
  double beyond = 0.0;  ///< how far its command is off for 0.2 s, at most [rad] or [m]
};

/// A drive that is too weak, friction and weight stop a joint as well, and let go while its command
/// is about as far off as when it came to rest. Held is a joint that rests while its command is
/// further on by several times the error that moves it elsewhere, and stays until that is back.
/// @param joint  column of recordings with commands (live_commands)
std::vector<HeldRows> find_held(const std::vector<Recording>& recordings, int joint);

/// "is held near −1.03 rad (at t = 60.4 s of arm.csv; 5.2 s in all), while …"
std::string held_text(const std::vector<Recording>& recordings, const std::vector<HeldRows>& held,
                      const std::string& unit);

}  // namespace diffnea::detail
