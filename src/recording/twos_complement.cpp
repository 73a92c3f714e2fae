#include "recording/twos_complement.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <diffnea/core/text.hpp>

#include "recording/audit_statistics.hpp"

namespace diffnea::detail {
namespace {

/// Share of a count that values may be off a multiple: numbers were printed with few digits.
constexpr double kOffCount = 0.05;
/// Share of the range on either side of its middle that a signed number small against it leaves
/// empty.
constexpr double kEmpty = 0.25;
/// Rows of either sign; fewer may be spikes.
constexpr long kFewest = 10;

}  // namespace

std::optional<TwosComplement> find_twos_complement(const VecX<double>& x) {
  std::vector<double> values;
  for (const double v : x)
    if (std::isfinite(v)) values.push_back(v);
  std::ranges::sort(values);
  if (values.size() < 2 * kFewest || values.front() < 0.0 || !(values.back() > 0.0))
    return std::nullopt;
  const double largest = values.back();
  const auto middle = std::ranges::upper_bound(values, 0.5 * largest);
  const long high = values.end() - middle, low = middle - values.begin();
  if (high < kFewest || low < kFewest) return std::nullopt;
  // The quantum, from the small values, whose digits tell it best.
  double quantum = largest;
  const double rounding = 1e-9 * *(middle - 1);
  for (auto it = values.begin(); it + 1 < middle; ++it)
    if (const double step = *(it + 1) - *it; step > rounding) quantum = std::min(quantum, step);
  if (values.front() > 0.0) quantum = std::min(quantum, values.front());
  double products = 0.0, squares = 0.0;  // printed numbers are rounded; all of them tell it better
  for (auto it = values.begin(); it < middle; ++it) {
    const double count = std::round(*it / quantum);
    products += *it * count;
    squares += count * count;
  }
  if (squares > 0.0) quantum = products / squares;
  for (const int bits : {8, 16, 32}) {
    const double counts = std::ldexp(1.0, bits);
    const double modulus = quantum * counts;
    if (!(largest < modulus * (1.0 + kOffCount / counts)) || largest < (0.5 + kEmpty) * modulus)
      continue;
    const double gap_begins = *(middle - 1), gap_ends = *middle;
    if (gap_begins > kEmpty * modulus || gap_ends < (1.0 - kEmpty) * modulus) continue;
    const auto is_count = [&](double v) {
      return std::abs(v / quantum - std::round(v / quantum)) < kOffCount;
    };
    if (!std::ranges::all_of(values.begin(), middle, is_count)) continue;
    return TwosComplement{bits, modulus, quantum, gap_ends, largest, high};
  }
  return std::nullopt;
}

std::string twos_complement_text(const TwosComplement& found, const std::string& channel,
                                 bool is_torque) {
  const std::string modulus = number_text(found.modulus, 9);
  const bool is_raw = std::abs(found.quantum - 1.0) < 1e-9;
  const std::string unit = is_torque ? (is_raw ? "COUNT*A" : "A") : (is_raw ? "COUNT*deg" : "deg");
  return std::to_string(found.rows) + " rows run from " + number_text(found.negative_least, 6) +
         " to " + number_text(found.negative_most, 6) + " and none between: two's complement of " +
         std::to_string(found.bits) + " bits, read as unsigned, so that they stand for " +
         number_text(found.negative_least - found.modulus, 6) + " to " +
         number_text(found.negative_most - found.modulus, 6) + "; end the column's unit in mod " +
         modulus + ", e.g. --map \"" + channel + "=" + channel + " [" + unit + " mod " + modulus +
         "]\"" + (is_raw ? " with what a count is for COUNT" : "");
}

}  // namespace diffnea::detail
