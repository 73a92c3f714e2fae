#pragma once
/// Signed numbers of a drive that were read as unsigned: −9 shows as 65527. Internal.

#include <optional>
#include <string>

#include <diffnea/core/scalar.hpp>

namespace diffnea::detail {

/// How a channel wraps.
struct TwosComplement {
  int bits = 16;
  double modulus = 65536.0;                          ///< 2^bits, in the channel's unit
  double quantum = 1.0;                              ///< a count, in the channel's unit
  double negative_least = 0.0, negative_most = 0.0;  ///< range that stands for negative numbers
  long rows = 0;                                     ///< number in that range
};

/// A channel of multiples of one quantum, none negative, that has values just below 2^8, 2^16 or
/// 2^32 counts and small ones, and none in the half between: a signed number never reaches a
/// quarter of its range without being through the numbers between.
/// @param x  NaN: a gap
std::optional<TwosComplement> find_twos_complement(const VecX<double>& x);

/// One sentence, with the unit that reads the column right.
std::string twos_complement_text(const TwosComplement& found, const std::string& channel,
                                 bool is_torque);

}  // namespace diffnea::detail
