#include "identify/fingerprint.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>

namespace diffnea {
namespace {

/// Rows of `motion`: a second and more, and the same for a recording and its first half.
constexpr long kMotionRows = 1000;

/// Fowler, Noll, Vo. Gaps are alike, whichever NaN stands for them.
void mix(std::uint64_t& hash, double x) {
  auto bits = std::bit_cast<std::uint64_t>(std::isnan(x) ? 0.0 : x);
  for (int byte = 0; byte < 8; ++byte, bits >>= 8) hash = (hash ^ (bits & 0xff)) * 0x100000001b3;
}

std::string digits(std::uint64_t hash) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

}  // namespace

void Fingerprint::add(const Recording& block) {
  const auto mix_row = [](std::uint64_t& hash, const RowMatX<double>& m, long i) {
    for (long j = 0; m.size() > 0 && j < m.cols(); ++j) mix(hash, m(i, j));
  };
  for (long i = 0; i < block.rows(); ++i, ++taken_) {
    if (taken_ < kMotionRows) {
      mix(motion_, block.time[i]);
      mix_row(motion_, block.q, i);
      mix_row(motion_, block.base, i);
    }
    for (const RowMatX<double>* m :
         {&block.q, &block.tau, &block.ball, &block.base, &block.base_wrench})
      mix_row(rows_, *m, i);
  }
}

std::string Fingerprint::motion() const { return std::string(kOfMotion) + digits(motion_); }
std::string Fingerprint::rows() const { return digits(rows_); }

}  // namespace diffnea
