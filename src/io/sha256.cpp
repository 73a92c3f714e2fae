#include "io/sha256.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "core/c_numbers.hpp"

namespace diffnea::io {
namespace {

using Words8 = std::array<std::uint32_t, 8>;

/// First 32 bits of the fraction of x.
std::uint32_t fraction_bits(long double x) {
  return static_cast<std::uint32_t>((x - std::floor(x)) * 4294967296.0L);
}

/// FIPS 180-4, 4.2.2 and 5.3.3: K from the cube roots of the first 64 primes, H from square roots
/// of the first 8.
struct Constants {
  std::array<std::uint32_t, 64> k{};
  Words8 h{};
  Constants() {
    int found = 0;
    for (int n = 2; found < 64; ++n) {
      bool prime = true;
      for (int d = 2; d * d <= n; ++d) prime = prime && n % d != 0;
      if (!prime) continue;
      if (found < 8) h[found] = fraction_bits(std::sqrt(static_cast<long double>(n)));
      k[found++] = fraction_bits(std::cbrt(static_cast<long double>(n)));
    }
  }
};

/// FIPS 180-4, 6.2.2: one block of 64 bytes.
void compress(const unsigned char* block, const Constants& c, Words8& state) {
  std::array<std::uint32_t, 64> w{};
  for (int t = 0; t < 16; ++t)
    w[t] = std::uint32_t{block[4 * t]} << 24 | std::uint32_t{block[4 * t + 1]} << 16 |
           std::uint32_t{block[4 * t + 2]} << 8 | std::uint32_t{block[4 * t + 3]};
  for (int t = 16; t < 64; ++t) {
    const std::uint32_t a = w[t - 15], b = w[t - 2];
    w[t] = w[t - 16] + (std::rotr(a, 7) ^ std::rotr(a, 18) ^ (a >> 3)) + w[t - 7] +
           (std::rotr(b, 17) ^ std::rotr(b, 19) ^ (b >> 10));
  }
  Words8 s = state;  // a … h
  for (int t = 0; t < 64; ++t) {
    const std::uint32_t t1 = s[7] +
                             (std::rotr(s[4], 6) ^ std::rotr(s[4], 11) ^ std::rotr(s[4], 25)) +
                             ((s[4] & s[5]) ^ (~s[4] & s[6])) + c.k[t] + w[t];
    const std::uint32_t t2 = (std::rotr(s[0], 2) ^ std::rotr(s[0], 13) ^ std::rotr(s[0], 22)) +
                             ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
    s = {t1 + t2, s[0], s[1], s[2], s[3] + t1, s[4], s[5], s[6]};
  }
  for (int i = 0; i < 8; ++i) state[i] += s[i];
}

}  // namespace

std::string sha256(std::string_view data) {
  static const Constants constants;
  Words8 state = constants.h;
  const auto* bytes = reinterpret_cast<const unsigned char*>(data.data());
  const std::size_t whole = data.size() / 64 * 64;
  for (std::size_t i = 0; i < whole; i += 64) compress(bytes + i, constants, state);
  // The rest, a bit 1, zeros, and the length in bits.
  std::array<unsigned char, 128> tail{};
  const std::size_t rest = data.size() - whole;
  for (std::size_t i = 0; i < rest; ++i) tail[i] = bytes[whole + i];
  tail[rest] = 0x80;
  const std::size_t length = rest < 56 ? 64 : 128;
  for (int i = 0; i < 8; ++i)
    tail[length - 1 - i] = static_cast<unsigned char>(std::uint64_t{data.size()} * 8 >> (8 * i));
  for (std::size_t i = 0; i < length; i += 64) compress(tail.data() + i, constants, state);
  std::string out;
  for (const std::uint32_t word : state) {
    char hex[9];
    detail::print(hex, sizeof hex, "%08x", word);
    out += hex;
  }
  return out;
}

}  // namespace diffnea::io
