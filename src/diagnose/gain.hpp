#pragma once
/// What something is worth on held-out data, from its mean squares. Internal to diagnose/.

#include <algorithm>
#include <cmath>

#include <diffnea/diagnose/cause.hpp>

namespace diffnea {

/// The mean square of held-out errors without and with something, and what is certain of the
/// difference.
struct HeldOutChange {
  double before = 0.0, after = 0.0;  ///< mean squares, noise is 1
  double low = 0.0, high = 0.0;      ///< 95 % interval of (before − after)/before, bootstrap
  /// Lower end of the interval of rows · log(before/after), each block of a noise of its own: an
  /// impact that comes elsewhere than predicted counts for no more than its block.
  double log_low = 0.0;
  bool helps() const { return low > 0.0 || (after < before && log_low > 0.0); }
};

/// @param floor  mean square that nothing removes
inline Gain gain_of(const HeldOutChange& change, double floor) {
  const double removed = std::max(change.before - change.after, 0.0);
  return {std::sqrt(change.before),
          std::sqrt(change.after),
          std::sqrt(floor),
          removed > 0.0 ? removed / std::max(change.before - floor, removed) : 0.0,
          change.low,
          change.high};
}

}  // namespace diffnea
