#pragma once
/// By how much a position follows its command. Internal.

#include <optional>
#include <string>
#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea::detail {

/// How one joint's position follows its command.
struct CommandLag {
  double seconds = 0.0;  ///< the position is that much later; negative: earlier
  double std = 0.0;      ///< standard error, from the spread of the blocks [s]
  double dt = 0.0;       ///< usual interval [s]
  /// Rms of the second difference, position over command: a drive smooths its command, so that of
  /// exchanged columns the ratio is large.
  double roughness = 0.0;

  /// The position comes before its command, by more than a row and chance.
  bool is_early(double significance) const { return seconds + significance * std < -dt; }
  /// From twice the command's roughness on, the position cannot be a drive's response.
  bool is_swapped() const { return roughness > 2.0; }
};

/// The shift between the rates of position and command with the largest correlation: the median over
/// blocks of a second and more.
/// @param joint  column
/// @return none if the command is not logged, or fewer than five blocks move
std::optional<CommandLag> find_command_lag(const std::vector<Recording>& recordings, int joint);

/// One sentence about a joint whose position comes first.
std::string early_text(const CommandLag& lag, const std::string& joint);

}  // namespace diffnea::detail
