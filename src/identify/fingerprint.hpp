#pragma once
/// What tells recordings apart, whichever file holds them. Internal.

#include <cstdint>
#include <string>
#include <string_view>

#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// How the fingerprint of a motion begins: those of earlier versions were of positions and torques.
inline constexpr std::string_view kOfMotion = "motion:";

/// Of one recording that comes block by block; the joints in the model's order.
class Fingerprint {
 public:
  void add(const Recording& block);
  /// RunDescription::motion.
  std::string motion() const;
  /// RunDescription::rows.
  std::string rows() const;

 private:
  static constexpr std::uint64_t kStart = 0xcbf29ce484222325;
  std::uint64_t motion_ = kStart, rows_ = kStart;
  long taken_ = 0;
};

}  // namespace diffnea
