#pragma once
/// Random numbers of a case, the same on every machine.

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <vector>

namespace rigs {

/// PCG-XSH-RR 64/32 (O'Neill 2014); a stream is its odd increment.
class Draw {
 public:
  Draw(std::uint64_t seed, std::uint64_t stream) : increment_((stream << 1U) | 1U) {
    next();
    state_ += seed;
    next();
  }

  /// [0, 1) with 53 bits.
  double uniform() {
    const std::uint64_t high = next() >> 5U, low = next() >> 6U;
    return (static_cast<double>(high) * 67108864.0 + static_cast<double>(low)) / 9007199254740992.0;
  }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform in the logarithm.
  double ratio(double low, double high) { return low * std::pow(high / low, uniform()); }
  bool chance(double p) { return uniform() < p; }
  double sign() { return chance(0.5) ? 1.0 : -1.0; }
  int index(int n) { return static_cast<int>(uniform() * n); }
  template <class T>
  T pick(const std::vector<T>& from) {
    return from[static_cast<std::size_t>(index(static_cast<int>(from.size())))];
  }
  double pick(std::initializer_list<double> from) { return pick(std::vector<double>(from)); }
  /// Standard normal, Marsaglia's polar method.
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double x = 0.0, y = 0.0, r = 0.0;
    do {
      x = uniform(-1.0, 1.0);
      y = uniform(-1.0, 1.0);
      r = x * x + y * y;
    } while (r >= 1.0 || r == 0.0);
    const double scale = std::sqrt(-2.0 * std::log(r) / r);
    spare_ = scale * y;
    has_spare_ = true;
    return scale * x;
  }

 private:
  std::uint32_t next() {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005ULL + increment_;
    const auto mixed = static_cast<std::uint32_t>(((old >> 18U) ^ old) >> 27U);
    const auto turn = static_cast<std::uint32_t>(old >> 59U);
    return (mixed >> turn) | (mixed << ((32U - turn) & 31U));
  }

  std::uint64_t state_ = 0, increment_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace rigs
